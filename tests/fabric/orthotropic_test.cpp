#include "weft/fabric/orthotropic.h"

#include <gmock/gmock.h>

#include <Eigen/LU>

#include "weft/base/error.h"

namespace weft::orthotropic_test {
namespace {

using ::testing::HasSubstr;

// By hand, from equation 6 of the paper: nu_vu = 0.4 * 280 / 100 = 1.12, d = 1 - 0.448 = 0.552.
TEST(Orthotropic, StiffnessOfCottonByHand) {
  const OrthotropicStiffness s = stiffness_of(OrthotropicModuli{100, 280, 40, 0.4, 5e-6});
  EXPECT_NEAR(s.c00, 181.15942028985507, 1e-10);
  EXPECT_NEAR(s.c11, 507.2463768115942, 1e-10);
  EXPECT_NEAR(s.c01, 202.89855072463768, 1e-10);
  EXPECT_EQ(s.c22, 40);
  EXPECT_EQ(s.b, 5e-6);
}

// The compliance matrix of an orthotropic sheet has 1 / E_u, 1 / E_v and - nu / E_u: a tension N_uu
// alone must strain by N_uu / E_u along u and by - nu times that along v.
TEST(Orthotropic, TensionAlongOneThreadContractsTheOther) {
  const OrthotropicModuli m{100, 280, 40, 0.4, 5e-6};
  const OrthotropicStiffness s = stiffness_of(m);
  Eigen::Matrix2d c;
  c << s.c00, s.c01, s.c01, s.c11;
  const Vec2 strain = c.inverse() * Vec2(3, 0);
  EXPECT_NEAR(strain[0], 3 / m.e_u, 1e-14);
  EXPECT_NEAR(strain[1], -m.poisson * 3 / m.e_u, 1e-14);
  const Vec2 across = c.inverse() * Vec2(0, 3);
  EXPECT_NEAR(across[1], 3 / m.e_v, 1e-14);
}

TEST(Orthotropic, ThereAndBackAgain) {
  const OrthotropicModuli m{1028, 3271, 9171, 0.2731, 2.35e-7};
  const Fabric fabric = orthotropic_fabric("f", stiffness_of(m));
  const OrthotropicModuli back = moduli_of(stiffness_of(fabric));
  EXPECT_NEAR(back.e_u, m.e_u, 1e-12 * m.e_u);
  EXPECT_NEAR(back.e_v, m.e_v, 1e-12 * m.e_v);
  EXPECT_EQ(back.shear, m.shear);
  EXPECT_NEAR(back.poisson, m.poisson, 1e-13);
  EXPECT_EQ(back.b, m.b);
  // A plate of rigidity b without Poisson effect: 1/2 b (K_uu^2 + K_vv^2 + 2 K_uv^2) against 1/2
  // (D11 K_uu^2 + D22 K_vv^2 + 4 D66 K_uv^2).
  EXPECT_EQ(4 * fabric.value("bend_twist"), 2 * m.b);
}

TEST(Orthotropic, UnitsOfThePaper) {
  // 1 N = 1e5 dyn and 1 m = 100 cm: 1 N/m = 1000 dyn/cm, 1 N m = 1e7 dyn cm, 1 kg/m^2 = 0.1 g/cm^2.
  const OrthotropicModuli si = moduli_from_cgs({1000, 2000, 3000, 0.25, 1e7});
  EXPECT_DOUBLE_EQ(si.e_u, 1);
  EXPECT_DOUBLE_EQ(si.e_v, 2);
  EXPECT_DOUBLE_EQ(si.shear, 3);
  EXPECT_EQ(si.poisson, 0.25);
  EXPECT_DOUBLE_EQ(si.b, 1);
  EXPECT_DOUBLE_EQ(areal_density_from_cgs(0.0224), 0.224);
}

TEST(Orthotropic, PresetsAreTheTables) {
  ASSERT_EQ(orthotropic_presets().size(), 10u);
  const OrthotropicModuli denim = moduli_of(stiffness_of(find_fabric("larionov-real-denim")));
  EXPECT_NEAR(denim.e_v, 20.590, 1e-12);
  EXPECT_NEAR(denim.poisson, 0.4286, 1e-13);
  EXPECT_NEAR(denim.b, 28.5e-7, 1e-18);
  EXPECT_NEAR(find_fabric("larionov-real-denim").areal_density.value(), 0.324, 1e-15);
  for (const Fabric& fabric : orthotropic_presets()) {
    EXPECT_NO_THROW(validate(fabric)) << fabric.name;
    EXPECT_THAT(fabric.provenance, HasSubstr("Table"));
  }
}

TEST(Orthotropic, RefusesWhatIsNoSheet) {
  EXPECT_THROW(stiffness_of(OrthotropicModuli{100, 280, 40, 0.6, 5e-6}), Error);  // d < 0
  EXPECT_THROW(stiffness_of(OrthotropicModuli{100, 280, 40, -0.1, 5e-6}), Error);
  EXPECT_THROW(moduli_of({100, 100, 101, 40, 1e-6}), Error);
  EXPECT_THROW(stiffness_of(Fabric::with_defaults("f")), Error);
}

}  // namespace
}  // namespace weft::orthotropic_test
