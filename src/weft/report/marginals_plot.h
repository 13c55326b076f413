#pragma once
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "weft/report/report.h"

namespace weft {

/// Samples of several parameters as pictures of their marginals: a histogram of each on the
/// diagonal, below it each pair as cells whose darkness is their share of the samples. An axis runs
/// over the middle 99 % of the samples, in the parameter's scale; its ends are printed.
struct MarginalsPlot {
  struct Parameter {
    std::string name;            ///< "bend_stiffness"
    std::string unit;            ///< "N m"
    std::vector<double> values;  ///< one a sample, in `unit`; the same number for each parameter
    ReportParameter::Scale scale = ReportParameter::Scale::logarithmic;
    /// Marked by a line and a cross; NaN: not.
    double estimate = std::numeric_limits<double>::quiet_NaN();
  };
  std::string title;
  std::vector<Parameter> parameters;
  int panel = 96;  ///< px, side of a panel
};

/// Throws Error for no parameter, no samples, or numbers of samples that differ.
/// `margin` px are added on all sides.
std::string to_svg(const MarginalsPlot& plot, double margin = 0);
/// Writes `path` (.svg). The samples are the caller's to write. Throws Error if it cannot be
/// written.
void write_plot(const std::filesystem::path& path, const MarginalsPlot& plot);

}  // namespace weft
