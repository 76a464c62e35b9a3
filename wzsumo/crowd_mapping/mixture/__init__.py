"""The Gaussian mixture of Chen et al. 2022: fit, choice of the number of components, maps."""
