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
