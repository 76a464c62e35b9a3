"""The figures of the mixture: counterparts of Figures 5, 6 and 7 of Chen et al. 2022."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from matplotlib.ticker import MaxNLocator

from wzsumo.study.result_folder import ResultFolder
from wzsumo.study.zone_axes import BLACK, BLUE, VERMILION, legend_above, new_figure, plain, show_zone

CHI2_95 = 5.991464547107979  # 95 % quantile of chi-squared with 2 degrees of freedom: -2 ln 0.05


def draw_criteria(run: ResultFolder) -> Figure:
    """AIC and BIC over the number of components (paper: Figure 5)."""
    figure, (axes,) = new_figure(1, row_height=3.2, head=0.4)
    sweep, chosen = run.sweep, run.result.get("n_components")
    for column, colour, marker in (("aic", BLUE, "o"), ("bic", VERMILION, "s")):
        axes.plot(sweep["n_components"], sweep[column], color=colour, marker=marker, markersize=4, label=column.upper())
    if chosen is not None:
        rule = str(run.result.get("n_components_rule", "-")).upper()
        axes.axvline(chosen, color=BLACK, linestyle="--", linewidth=1, label=f"chosen K = {chosen} ({plain(rule)})")
    axes.set(xlabel="number of components K [-]", ylabel="criterion [-], lower is better")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(color="#E5E5E5")
    axes.legend(frameon=False)
    return figure


def draw_components(run: ResultFolder) -> Figure:
    """The components as 95 % ellipses over the used traces (paper: Figure 6)."""
    figure, (axes,) = new_figure(1, row_height=2.6)
    show_zone(axes, run)
    traces = run.used_traces
    axes.scatter(traces["x_m"], traces["y_m"], s=2, color=BLUE, alpha=0.5, linewidths=0, label="fix (vehicle centre)")
    _, means, covariances = run.mixture
    for number, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        variances, directions = np.linalg.eigh(covariance)
        minor, major = 2 * np.sqrt(CHI2_95 * variances)
        angle = np.rad2deg(np.arctan2(directions[1, 1], directions[0, 1]))
        label = None if number else "component, 95 %"
        axes.add_patch(
            Ellipse(mean, major, minor, angle=angle, fill=False, edgecolor=BLACK, linewidth=1, label=label, zorder=6)
        )
    legend_above(figure, axes)
    return figure


def draw_samples(run: ResultFolder) -> Figure:
    """The points drawn from the mixture (paper: Figure 7)."""
    figure, (axes,) = new_figure(1, row_height=2.6)
    show_zone(axes, run)
    samples = run.samples
    axes.scatter(samples["x_m"], samples["y_m"], s=2, color=BLUE, alpha=0.5, linewidths=0, label="sample")
    legend_above(figure, axes)
    return figure
