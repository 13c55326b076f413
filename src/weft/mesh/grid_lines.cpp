#include "weft/mesh/grid_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr double kSameLine = 1e-9;  // m
constexpr double kRounding = 1e-9;  // of an interval

void check_lines(const std::vector<double>& lines) {
  if (lines.size() < 2) throw Error("grid: at least two lines each way are needed");
  for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
    if (!(lines[i] < lines[i + 1]) || !std::isfinite(lines[i + 1] - lines[i]))
      throw Error(fmt::format("grid: line at {:g} m is not before {:g} m", lines[i], lines[i + 1]));
  }
}

}  // namespace

std::vector<double> grid_lines(double length, std::vector<double> borders, double spacing) {
  if (!(length > 0) || !std::isfinite(length) || !(spacing > 0))
    throw Error(
        fmt::format("grid of {:g} m with spacing {:g} m: both must be above 0", length, spacing));
  for (const double border : borders)
    if (!std::isfinite(border)) throw Error("grid: a border is not a finite number");
  std::sort(borders.begin(), borders.end());
  std::vector<double> fixed{0.0};
  for (const double border : borders)
    if (border > fixed.back() + kSameLine && border < length - kSameLine) fixed.push_back(border);
  fixed.push_back(length);
  std::vector<double> lines{0.0};
  for (std::size_t i = 0; i + 1 < fixed.size(); ++i) {
    const double width = fixed[i + 1] - fixed[i];
    const int count = std::max(1, static_cast<int>(std::ceil(width / spacing - kRounding)));
    for (int k = 1; k < count; ++k) lines.push_back(fixed[i] + width * k / count);
    lines.push_back(fixed[i + 1]);
  }
  return lines;
}

std::vector<double> graded_lines(double lower, double upper, const GridGrading& grading) {
  const auto& [spacing, first, growth, fine_lower, fine_upper] = grading;
  if (!(lower < upper) || !std::isfinite(upper - lower) || !(first > 0) || !(first <= spacing) ||
      !(growth > 0))
    throw Error(fmt::format("graded grid from {:g} to {:g} m, cells of {:g} to {:g} m: not valid",
                            lower, upper, first, spacing));
  // Cells counted from `lower`, as the integral of 1 / width by the midpoint rule; the lines are
  // where it passes whole parts.
  constexpr int kSteps = 2000;
  const double step = (upper - lower) / kSteps;
  std::vector<double> count{0.0};
  for (int i = 0; i < kSteps; ++i) {
    const double x = (i + 0.5) * step;
    double width = spacing;
    if (fine_lower) width = std::min(width, first + growth * x);
    if (fine_upper) width = std::min(width, first + growth * (kSteps * step - x));
    count.push_back(count.back() + step / width);
  }
  const int cells = std::max(1, static_cast<int>(std::ceil(count.back() - kRounding)));
  std::vector<double> lines{lower};
  std::size_t at = 1;
  for (int k = 1; k < cells; ++k) {
    const double wanted = count.back() * k / cells;
    while (count[at] < wanted) ++at;
    const double part = (wanted - count[at - 1]) / (count[at] - count[at - 1]);
    lines.push_back(lower + (static_cast<double>(at - 1) + part) * step);
  }
  lines.push_back(upper);
  return lines;
}

TriangleMesh make_swatch(const std::vector<double>& u, const std::vector<double>& v,
                         GridPattern pattern) {
  check_lines(u);
  check_lines(v);
  TriangleMesh mesh =
      make_swatch(1, 1, static_cast<int>(u.size()), static_cast<int>(v.size()), pattern);
  Eigen::Index vertex = 0;
  for (const double row : v)
    for (const double column : u) mesh.material.col(vertex++) = Vec2(column, row);
  return mesh;
}

}  // namespace weft
