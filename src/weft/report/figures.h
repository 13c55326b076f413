#pragma once
#include <vector>

#include "weft/report/plot.h"
#include "weft/report/report.h"

namespace weft {

/// The figures of Bhat et al. 2003 and those that go with them, as plots ready to be written.

/// Error per frame; validation frames shaded.
LinePlot error_plot(const ReportCapture& capture);
/// The two parts of the error per frame: fold and alpha times silhouette, that is error minus fold.
LinePlot error_parts_plot(const ReportCapture& capture);
/// Mean distance to the true surface against time, mm, with the largest. Empty series where the
/// capture has none.
LinePlot distance_plot(const ReportCapture& capture);
/// Mean distances of several, against time ("two meshes", "weft against truth"), mm. x of the
/// series in s, y in m.
LinePlot distance_plot(const std::vector<PlotSeries>& series);
/// Errors in the order of the evaluations, by phase, and the best of each phase so far (Fig. 5).
LinePlot search_plot(const std::vector<ReportHistoryPoint>& history);
/// Temperature of the annealing (Fig. 5).
LinePlot temperature_plot(const std::vector<ReportHistoryPoint>& history);
/// Errors about the estimate and the fitted quadratic, with the level 1 % above its minimum (Fig.
/// 4).
LinePlot perturbation_plot(const ReportPerturbation& perturbation);
/// Variability of each parameter that has one, log scale (Fig. 11).
BarChart variability_chart(const std::vector<ReportParameter>& parameters);
/// Correlation of the parameters, -1 to 1; hatched where one is not determined.
HeatMap correlation_map(const ReportCertainty& certainty);
/// Fig. 3.
HeatMap surface_map(const ReportSurface& surface);
/// The first row of errors, along x alone.
LinePlot surface_line(const ReportSurface& surface);
/// Fig. 14: a line per capture over the fabrics; and the same as a table, the least of each row
/// outlined.
LinePlot matrix_plot(const ReportMatrix& matrix);
HeatMap matrix_map(const ReportMatrix& matrix);
/// Energy against time, one series an integrator. x in s, y in J.
LinePlot energy_plot(const std::vector<PlotSeries>& series);

/// Error against step or mesh size, both axes logarithmic, with the slope fitted by least squares
/// to each series in the legend ("bdf2, order 1.98") and a dashed line for each slope in `guides`
/// through the finest point of the series that is nearest to it. Points that are not positive are
/// left out.
LinePlot convergence_plot(const std::string& title, const PlotAxis& size, const PlotAxis& error,
                          std::vector<PlotSeries> series, const std::vector<double>& guides = {});
/// Slope of log y over log x by least squares; NaN with fewer than two usable points.
double fitted_order(const PlotSeries& series);

}  // namespace weft
