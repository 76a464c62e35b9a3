"""The figures of the mixture: counterparts of Figures 5, 6 and 7 of Chen et al. 2022."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from wzsumo.figures.zone_axes import BLACK, BLUE, VERMILION, legend_above, new_figure, plain, show_zone
from wzsumo.files.result_folder import ResultFolder

CHI2_95 = 5.991464547107979  # 95 % quantile of chi-squared with 2 degrees of freedom: -2 ln 0.05


def draw_criteria(run: ResultFolder) -> Figure:
    """AIC and BIC over the number of components (paper: Figure 5)."""
    figure, (axes,) = new_figure(1, row_height=3.2, head=0.4)
    tried, chosen = run.mixtures_tried, run.result.get("n_components")
    for column, colour, marker in (("aic", BLUE, "o"), ("bic", VERMILION, "s")):
        axes.plot(tried["n_components"], tried[column], color=colour, marker=marker, markersize=4, label=column.upper())
    if chosen is not None:
        rule = str(run.result.get("n_components_rule", "-")).upper()
        axes.axvline(chosen, color=BLACK, linestyle="--", linewidth=1, label=f"chosen K = {chosen} ({plain(rule)})")
    axes.set(xlabel="number of components K [-]", ylabel="criterion [-], lower is better")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(color="#E5E5E5")
    axes.legend(frameon=False)
    return figure


def draw_components(run: ResultFolder) -> Figure:
    """The components as 95 % ellipses over the fixes of the used traces (paper: Figure 6)."""
    figure, (axes,) = new_figure(1, row_height=2.6)
    show_zone(axes, run)
    traces = run.used_traces
    stations, offsets = run.road.to_sd(traces[["x_m", "y_m"]])
    axes.scatter(stations, offsets, s=2, color=BLUE, alpha=0.5, linewidths=0, label="fix (vehicle centre)", rasterized=True)
    _, means, covariances = run.mixture
    turn = np.linspace(0, 2 * np.pi, 181)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    for number, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        variances, directions = np.linalg.eigh(covariance)
        ellipse = mean + circle * np.sqrt(CHI2_95 * variances) @ directions.T
        label = None if number else "component, 95 %"
        axes.plot(*ellipse.T, color=BLACK, linewidth=1, label=label, zorder=6)
    legend_above(figure, axes)
    return figure


def draw_samples(run: ResultFolder) -> Figure:
    """The points drawn from the mixture (paper: Figure 7)."""
    figure, (axes,) = new_figure(1, row_height=2.6)
    show_zone(axes, run)
    stations, offsets = run.road.to_sd(run.samples[["x_m", "y_m"]])
    axes.scatter(stations, offsets, s=2, color=BLUE, alpha=0.5, linewidths=0, label="sample", rasterized=True)
    legend_above(figure, axes)
    return figure
