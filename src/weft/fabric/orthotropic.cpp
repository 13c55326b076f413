#include "weft/fabric/orthotropic.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr double kNewtonPerMetre = 1e-3;   // of a dyn/cm
constexpr double kNewtonMetre = 1e-7;      // of a dyn cm
constexpr double kKilogramPerSquare = 10;  // of a g/cm^2

struct Column {
  const char *name, *place;
  double density;  // g/cm^2; 0: not stated
  OrthotropicModuli cgs;
};
constexpr Column kColumns[] = {
    {"larionov-cotton", "Table 1, top", 0, {1.0e5, 2.8e5, 4.0e4, 0.4, 50}},
    {"larionov-denim", "Table 1, top", 0, {5.0e5, 7.0e5, 2.0e4, 0.45, 200}},
    {"larionov-silk", "Table 1, top", 0, {2.0e5, 3.0e5, 1.5e4, 0.35, 10}},
    {"larionov-initial", "Table 1, middle", 0, {2.0e5, 1.8e5, 5.0e4, 0.3, 10}},
    {"larionov-houdini-denim", "Table 2", 0.0324, {34182, 33735, 5592, 0.2609, 11.0}},
    {"larionov-houdini-cotton", "Table 2", 0.0224, {30823, 30266, 4971, 0.3058, 1.19}},
    {"larionov-houdini-silk", "Table 2", 0.0187, {7492, 7436, 1193, 0.03543, 0.100}},
    {"larionov-real-denim", "Table 3", 0.0324, {3793, 20590, 6968, 0.4286, 28.5}},
    {"larionov-real-cotton", "Table 3", 0.0224, {1840, 2019, 6538, 0.4308, 8.99}},
    {"larionov-real-polyester", "Table 3", 0.0187, {1028, 3271, 9171, 0.2731, 2.35}},
};

std::vector<Fabric> make_orthotropic_presets() {
  std::vector<Fabric> presets;
  for (const Column& column : kColumns) {
    Fabric fabric = orthotropic_fabric(column.name, stiffness_of(moduli_from_cgs(column.cgs)));
    if (column.density > 0) fabric.areal_density = areal_density_from_cgs(column.density);
    fabric.provenance = fmt::format("Larionov 2022, {}, CGS converted to SI", column.place);
    presets.push_back(std::move(fabric));
  }
  return presets;
}

}  // namespace

OrthotropicStiffness stiffness_of(const OrthotropicModuli& m) {
  const double nu_vu = m.poisson * m.e_v / m.e_u;
  const double d = 1 - m.poisson * nu_vu;
  if (!(m.e_u > 0) || !(m.e_v > 0) || !(m.shear > 0) || !(m.b > 0) || !(m.poisson >= 0) ||
      !(d > 0) || !std::isfinite(m.e_u + m.e_v + m.shear + m.b))
    throw Error(
        fmt::format("E_u {:g}, E_v {:g}, mu {:g} N/m, nu {:g}, b {:g} N m: moduli must be above 0, "
                    "nu at least 0 and nu^2 E_v / E_u below 1",
                    m.e_u, m.e_v, m.shear, m.poisson, m.b));
  return {m.e_u / d, m.e_v / d, m.poisson * m.e_v / d, m.shear, m.b};
}

OrthotropicModuli moduli_of(const OrthotropicStiffness& s) {
  const double d = 1 - s.c01 * s.c01 / (s.c00 * s.c11);
  if (!(s.c00 > 0) || !(s.c11 > 0) || !(s.c22 > 0) || !(s.b > 0) || !(s.c01 >= 0) || !(d > 0))
    throw Error(
        fmt::format("C00 {:g}, C11 {:g}, C01 {:g}, C22 {:g} N/m, b {:g} N m: must be above 0 with "
                    "C01^2 below C00 C11",
                    s.c00, s.c11, s.c01, s.c22, s.b));
  return {s.c00 * d, s.c11 * d, s.c22, s.c01 / s.c11, s.b};
}

Fabric orthotropic_fabric(std::string name, const OrthotropicStiffness& s) {
  Fabric fabric = Fabric::with_defaults(std::move(name), "stvk");
  fabric.set("membrane_uu", s.c00);
  fabric.set("membrane_vv", s.c11);
  fabric.set("membrane_uv", s.c01);
  fabric.set("membrane_shear", s.c22);
  fabric.set("bend_uu", s.b);
  fabric.set("bend_vv", s.b);
  fabric.set("bend_uv", kNoBendCoupling);
  fabric.set("bend_twist", 0.5 * s.b);
  return fabric;
}

bool is_orthotropic_sheet(const Fabric& fabric) { return fabric.model == "stvk"; }

OrthotropicStiffness stiffness_of(const Fabric& fabric) {
  require_model(fabric, "stvk");
  return {fabric.value("membrane_uu"), fabric.value("membrane_vv"), fabric.value("membrane_uv"),
          fabric.value("membrane_shear"),
          0.5 * (fabric.value("bend_uu") + fabric.value("bend_vv"))};
}

OrthotropicModuli moduli_from_cgs(const OrthotropicModuli& cgs) {
  return {kNewtonPerMetre * cgs.e_u, kNewtonPerMetre * cgs.e_v, kNewtonPerMetre * cgs.shear,
          cgs.poisson, kNewtonMetre * cgs.b};
}

double areal_density_from_cgs(double cgs) { return kKilogramPerSquare * cgs; }

const std::vector<Fabric>& orthotropic_presets() {
  static const std::vector<Fabric> kPresets = make_orthotropic_presets();
  return kPresets;
}

}  // namespace weft
