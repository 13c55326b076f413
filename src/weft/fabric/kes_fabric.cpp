#include "weft/fabric/kes_fabric.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "weft/base/error.h"
#include "weft/base/toml_reader.h"

namespace weft {
namespace {

constexpr double kCentimetre = 1e-2;                   // m
constexpr double kSlopeShear = 0.5 * kDegree;          // where KES begins to take the slope
constexpr double kSlopeCurvature = 0.5 / kCentimetre;  // 1/m
constexpr double kScalesToSaturation = 3;              // model/friction.h
constexpr double kStraightLine = 2.0 / 3;              // least LT of a straight k(strain)
constexpr Range kLinearity{0.2, 1.3};
constexpr Range kElongation{0.1, 300};    // %
constexpr Range kShear{1e-3, 100};        // gf/(cm deg)
constexpr Range kBending{1e-5, 100};      // gf cm^2/cm
constexpr Range kHysteresis{1e-5, 1000};  // gf/cm, and gf cm/cm
constexpr Range kLoad{1, 10000};          // gf/cm
constexpr Range kWeight{0.1, 1000};       // mg/cm^2

struct Direction {
  StiffnessCurve stretch{1.0};
  double shear = 0, bend = 0;
  std::optional<double> shear_hysteresis, bend_hysteresis;
};

Direction read_direction(const TomlTable& table, double load) {
  Direction d;
  const double strain = table.number("EMT", kElongation) / 100;
  const double linearity = table.optional_number("LT", kLinearity).value_or(1);
  d.stretch = kes::tensile_curve(kes::force_per_width(load), strain, linearity);
  d.shear = kes::shear_stiffness(table.number("G", kShear));
  d.bend = kes::bending_rigidity(table.number("B", kBending));
  if (const auto hg = table.optional_number("2HG", kHysteresis))
    d.shear_hysteresis = kes::force_per_width(*hg);
  if (const auto hb = table.optional_number("2HB", kHysteresis))
    d.bend_hysteresis = kes::moment_per_width(*hb);
  table.finish();
  return d;
}

void add_friction(Fabric& fabric, const std::string& row, double hysteresis, double scale) {
  fabric.include(row + "_friction");
  fabric.include(row + "_friction_scale");
  fabric.set(row + "_friction", hysteresis / 2);
  fabric.set(row + "_friction_scale", scale);
}

/// A curve's values within the range that a fabric file may hold.
StiffnessCurve within_range(const StiffnessCurve& curve, double least) {
  return {curve.knots(), curve.values().cwiseMax(least)};
}

}  // namespace

namespace kes {

double force_per_width(double gf_per_cm) { return gf_per_cm * kGramForce / kCentimetre; }
double shear_stiffness(double gf_per_cm_deg) { return force_per_width(gf_per_cm_deg) / kDegree; }
double bending_rigidity(double gf_cm2_per_cm) { return gf_cm2_per_cm * kGramForce * kCentimetre; }
double moment_per_width(double gf_cm_per_cm) { return gf_cm_per_cm * kGramForce; }
double areal_density(double mg_per_cm2) { return mg_per_cm2 * 1e-6 / (kCentimetre * kCentimetre); }

StiffnessCurve tensile_curve(double stress, double strain, double linearity) {
  if (!(stress > 0) || !(strain > 0) || !(linearity >= kLinearity.lower) ||
      !(linearity <= kLinearity.upper))
    throw Error(
        fmt::format("tensile curve of {:g} N/m at a strain of {:g} with linearity {:g}: "
                    "stress and strain must be above 0, linearity {:g} to {:g}",
                    stress, strain, linearity, kLinearity.lower, kLinearity.upper));
  const double last = stress / strain;
  if (linearity == 1) return StiffnessCurve(last);
  // With k = k0 + (k1 - k0) c / c1 the energy is c1^2 (k0 / 6 + k1 / 3).
  if (linearity >= kStraightLine) return {Vec2(0, strain), Vec2((3 * linearity - 2) * last, last)};
  // Three knots: first the middle value falls from the straight line's to zero, then the part where
  // k is zero grows from one half.
  const auto curve = [&](double bend) {
    const double part = std::max(0.5, bend - 0.5), middle = std::max(0.0, 0.5 - bend) * last;
    return StiffnessCurve(Vec3(0, part * strain, strain), Vec3(0, middle, last));
  };
  double low = 0, high = 1.5 - 1e-3;  // the energy falls as `bend` grows
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    const double energy = curve(middle).respond(strain).energy;
    (energy > 0.5 * linearity * stress * strain ? low : high) = middle;
  }
  return curve(low);
}

}  // namespace kes

Fabric read_kes_fabric(const std::filesystem::path& path) {
  const TomlTable file = TomlTable::parse_file(path);
  file.choice("format", {"weft-kes"});
  file.integer("version", 1, 1);
  Fabric fabric = Fabric::with_defaults(file.optional_string("name").value_or(path.stem().string()),
                                        "soft-constraints");
  if (const auto weight = file.optional_number("W", kWeight))
    fabric.areal_density = kes::areal_density(*weight);
  const double load = file.optional_number("maximum_load", kLoad).value_or(500);
  const Direction weft = read_direction(file.table("weft"), load);
  const Direction warp = read_direction(file.table("warp"), load);
  file.finish();
  if (weft.shear_hysteresis.has_value() != warp.shear_hysteresis.has_value())
    throw error_at({path, 0, "2HG"}, "needed for both directions or none");

  const double least = fabric.info(fabric.first_value("weft_stretch")).lower;
  fabric.set_curve("weft_stretch", within_range(weft.stretch, least));
  fabric.set_curve("warp_stretch", within_range(warp.stretch, least));
  fabric.set("shear", 0.5 * (weft.shear + warp.shear));
  fabric.set("weft_bend", weft.bend);
  fabric.set("warp_bend", warp.bend);
  fabric.set("diagonal_bend", std::sqrt(weft.bend * warp.bend));
  if (weft.shear_hysteresis)
    add_friction(fabric, "shear", 0.5 * (*weft.shear_hysteresis + *warp.shear_hysteresis),
                 kSlopeShear / kScalesToSaturation);
  if (weft.bend_hysteresis)
    add_friction(fabric, "weft_bend", *weft.bend_hysteresis, kSlopeCurvature / kScalesToSaturation);
  if (warp.bend_hysteresis)
    add_friction(fabric, "warp_bend", *warp.bend_hysteresis, kSlopeCurvature / kScalesToSaturation);
  fabric.provenance = fmt::format(
      "KES-F numbers of {}; diagonal_bend is not measured, the geometric mean of weft and warp",
      path.filename().string());
  validate(fabric);
  return fabric;
}

}  // namespace weft
