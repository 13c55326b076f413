#include "weft/capture/landmark_file.h"

#include <fmt/format.h>

#include "weft/base/text_file.h"
#include "weft/capture/table_file.h"

namespace weft {

namespace {

/// As register_scan() wants it.
void check_on_swatch(const TableFile& table, std::size_t row, const Vec2& uv,
                     const GridTemplate& swatch) {
  constexpr double rounding = 1e-9;  // m
  const Vec2 size(swatch.width, swatch.height);
  for (Eigen::Index axis = 0; axis < 2; ++axis)
    if (!(uv[axis] >= -rounding && uv[axis] <= size[axis] + rounding))
      throw table.fail(
          row, axis == 0 ? "u_m" : "v_m",
          fmt::format("{:g} is off the swatch; must be in [0, {:g}]", uv[axis], size[axis]));
}

}  // namespace

std::vector<Landmark> read_landmarks(const std::filesystem::path& path,
                                     const GridTemplate& swatch) {
  const TableFile table(path);
  const VecX u = table.numbers("u_m"), v = table.numbers("v_m"), x = table.numbers("x_m"),
             y = table.numbers("y_m"), z = table.numbers("z_m");
  const VecX weight = table.has("weight") ? table.numbers("weight") : VecX(VecX::Ones(u.size()));
  std::vector<Landmark> landmarks;
  for (Eigen::Index k = 0; k < u.size(); ++k) {
    const auto row = static_cast<std::size_t>(k);
    check_on_swatch(table, row, Vec2(u[k], v[k]), swatch);
    if (!(weight[k] >= 0)) throw table.fail(row, "weight", "must be at least 0");
    landmarks.push_back({Vec2(u[k], v[k]), Vec3(x[k], y[k], z[k]), weight[k]});
  }
  return landmarks;
}

void write_landmarks(const std::filesystem::path& path, const std::vector<Landmark>& landmarks) {
  std::string text = "u_m,v_m,x_m,y_m,z_m,weight\n";
  for (const Landmark& l : landmarks)
    text += fmt::format("{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}\n", l.uv.x(), l.uv.y(),
                        l.position.x(), l.position.y(), l.position.z(), l.weight);
  write_text(path, text);
}

}  // namespace weft
