#include "weft/dynamics/xpbd_constraints.h"

#include <gtest/gtest.h>

#include "common/gradient_check.h"
#include "weft/base/random.h"

namespace weft::xpbd::xpbd_constraints_test {
namespace {

using weft::testing::near;
using weft::testing::numeric_jacobian;

constexpr double kStep = 1e-3;  // of positions of about 1

const OrthotropicSheet kSheet{.c00 = 500, .c11 = 800, .c01 = 150, .c22 = 90, .bend = 20};
constexpr double kTime = 0.02;  // s

template <class K>
struct Case;
template <>
struct Case<GreenTriangle> {
  static GreenTriangle::Rest<double> rest() {
    return {triangle_shape(Vec2(0.1, 0), Vec2(1.2, 0.2), Vec2(0.3, 0.9))};
  }
  static BlockLaw law(const OrthotropicSheet& sheet) { return {sheet, kTime}; }
};
template <>
struct Case<DihedralHinge> {
  static DihedralHinge::Rest<double> rest() { return {1.7, 0.3, 0}; }
  static ScalarLaw law(const OrthotropicSheet& sheet) { return {sheet.bend, 4, kTime}; }
};
template <>
struct Case<TriangleBend> {
  static TriangleBend::Rest<double> rest() {
    return {{{{{0.5, 0.7, 0.1}, {0.2, -0.4, 0.9}, {-0.3, 0.8, 0.6}}}}, 0.6, {}};
  }
  static ScalarLaw law(const OrthotropicSheet& sheet) { return {sheet.bend, 4, kTime}; }
};

/// Two or four triangles around one, neither flat nor regular.
template <class K>
VecX shape() {
  Points x(3, 6);
  x << 0.0, 1.1, 0.3, 0.5, 1.2, -0.6,  //
      0.1, 0.0, 0.9, -0.8, 0.9, 0.5,   //
      0.0, 0.2, -0.1, 0.3, 0.5, 0.4;
  if constexpr (K::kVertices == 4) x.col(3) << 0.4, -0.7, 0.35;
  return flat(x).head(3 * static_cast<Eigen::Index>(K::kVertices));
}

template <class K>
std::array<Vector3<double>, K::kVertices> vertices(const VecX& x) {
  std::array<Vector3<double>, K::kVertices> out;
  for (std::size_t i = 0; i < K::kVertices; ++i)
    out[i] = to_vector3(Vec3(x.segment<3>(3 * static_cast<Eigen::Index>(i))));
  return out;
}

template <std::size_t N>
VecX to_vector(const Rows<double, N>& a) {
  return Eigen::Map<const VecX>(a.data(), N);
}
VecX to_vector(const Symmetric<double, 1>& a) { return VecX::Constant(1, a.m); }
VecX to_vector(const Symmetric<double, 3>& a) {
  VecX out(6);
  out << a.xx, a.yx, a.yy, a.zx, a.zy, a.zz;
  return out;
}
template <std::size_t N>
VecX to_vector(const std::array<Vector3<double>, N>& a) {
  VecX out(3 * static_cast<Eigen::Index>(N));
  for (std::size_t i = 0; i < N; ++i)
    out.segment<3>(3 * static_cast<Eigen::Index>(i)) = to_eigen(a[i]);
  return out;
}

template <class K>
Rows<double, K::kRows> multipliers() {
  if constexpr (K::kRows == 1) {
    return {0.7};
  } else {
    return {0.7, -0.4, 1.1};
  }
}
template <class K>
std::array<double, K::kVertices> weights() {
  std::array<double, K::kVertices> w;
  for (std::size_t i = 0; i < w.size(); ++i) w[i] = 1 + 0.5 * static_cast<double>(i);
  return w;
}

template <class K>
class XpbdConstraint : public ::testing::Test {};
using Kinds = ::testing::Types<GreenTriangle, DihedralHinge, TriangleBend>;
TYPED_TEST_SUITE(XpbdConstraint, Kinds);

TYPED_TEST(XpbdConstraint, PullIsTheGradientOfTheValue) {
  using K = TypeParam;
  const auto rest = Case<K>::rest();
  const auto value = [&](const VecX& x) {
    return to_vector(K::strain(rest, vertices<K>(x)).value());
  };
  const MatX gradient = numeric_jacobian(value, shape<K>(), kStep).transpose();
  const auto l = multipliers<K>();
  const auto strain = K::strain(rest, vertices<K>(shape<K>()));
  EXPECT_TRUE(near(to_vector(strain.pull(l)), gradient * to_vector(l)));
}

TYPED_TEST(XpbdConstraint, MobilityIsTheGradientsProduct) {
  using K = TypeParam;
  const auto strain_rest = Case<K>::rest();
  const auto strain = K::strain(strain_rest, vertices<K>(shape<K>()));
  MatX gradient(shape<K>().size(), static_cast<Eigen::Index>(K::kRows));
  VecX w(gradient.rows());
  for (std::size_t k = 0; k < K::kRows; ++k) {
    Rows<double, K::kRows> unit{};
    unit[k] = 1;
    gradient.col(static_cast<Eigen::Index>(k)) = to_vector(strain.pull(unit));
  }
  for (Eigen::Index i = 0; i < w.size(); ++i) w[i] = weights<K>()[static_cast<std::size_t>(i / 3)];
  const MatX expected = gradient.transpose() * w.asDiagonal() * gradient;
  const auto l = multipliers<K>();
  EXPECT_TRUE(near(to_vector(strain.mobility(weights<K>()) * l), expected * to_vector(l), 1e-13));
}

TYPED_TEST(XpbdConstraint, ChangesAreDerivativesAlongADirection) {
  using K = TypeParam;
  const auto rest = Case<K>::rest();
  const VecX x = shape<K>();
  Rng rng(5);
  VecX dx(x.size());
  for (double& entry : dx) entry = rng.normal();
  const auto l = multipliers<K>();
  const auto strain = K::strain(rest, vertices<K>(x));
  const auto change = K::change(rest, strain, vertices<K>(dx));
  const auto along = [&](const auto& f) {
    return weft::testing::derivative(f, x, dx, 0.3 * kStep);
  };
  const auto at = [&](const VecX& y) { return K::strain(rest, vertices<K>(y)); };
  EXPECT_TRUE(near(to_vector(change.value()),
                   along([&](const VecX& y) { return to_vector(at(y).value()); })));
  EXPECT_TRUE(near(to_vector(change.pull(l)),
                   along([&](const VecX& y) { return to_vector(at(y).pull(l)); })));
  EXPECT_TRUE(near(to_vector(change.mobility(weights<K>())),
                   along([&](const VecX& y) { return to_vector(at(y).mobility(weights<K>())); })));
}

TYPED_TEST(XpbdConstraint, LocalSystemIsSolvedAndStressIsItsRest) {
  // Equation 3: at the stress of a strain, over 1 / h^2, nothing changes.
  using K = TypeParam;
  const auto rest = Case<K>::rest();
  const auto strain = K::strain(rest, vertices<K>(shape<K>()));
  const auto law = Case<K>::law(kSheet);
  auto l = law.stress(rest.weight(), strain.value());
  for (double& entry : l) entry *= kTime * kTime;
  const auto m = strain.mobility(weights<K>());
  const auto at_rest = law.solve(rest.weight(), strain.value(), m, l).change;
  EXPECT_LT(to_vector(at_rest).norm(), 1e-12 * to_vector(l).norm());
  // From zero, what is gained is the stress at C + mobility dl.
  const auto gained = law.solve(rest.weight(), strain.value(), m, {}).change;
  auto after = m * gained;
  for (std::size_t k = 0; k < K::kRows; ++k) after[k] += strain.value()[k];
  EXPECT_TRUE(
      near(to_vector(gained), kTime * kTime * to_vector(law.stress(rest.weight(), after)), 1e-12));
}

TYPED_TEST(XpbdConstraint, LawsHaveTheirDerivatives) {
  // Everything moves with the parameter: strain, mobility and multipliers by given rates.
  using K = TypeParam;
  const auto rest = Case<K>::rest();
  const VecX x = shape<K>();
  Rng rng(9);
  VecX dx(x.size());
  for (double& entry : dx) entry = rng.normal();
  const auto strain = K::strain(rest, vertices<K>(x));
  const auto change = K::change(rest, strain, vertices<K>(dx));
  const auto l = multipliers<K>();
  Rows<double, K::kRows> dl{};
  for (double& entry : dl) entry = rng.normal();
  for (int p = 0; p < kSheetParameters; ++p) {
    const auto moved = [&](double t) {
      OrthotropicSheet sheet = kSheet;
      double* values[] = {&sheet.c00, &sheet.c11, &sheet.c01, &sheet.c22, &sheet.bend};
      *values[p] += t;
      Rows<double, K::kRows> lt = l;
      for (std::size_t k = 0; k < K::kRows; ++k) lt[k] += t * dl[k];
      const auto st = K::strain(rest, vertices<K>(x + t * dx));
      const auto law = Case<K>::law(sheet);
      const auto solved = law.solve(rest.weight(), st.value(), st.mobility(weights<K>()), lt);
      return std::pair(to_vector(solved.change), to_vector(law.stress(rest.weight(), st.value())));
    };
    const VecX zero = VecX::Zero(1), one = VecX::Ones(1);
    const auto law = Case<K>::law(kSheet);
    const auto solution =
        law.solve(rest.weight(), strain.value(), strain.mobility(weights<K>()), l);
    const auto analytic =
        solution.derivative(p, change.value(), change.mobility(weights<K>()) * solution.change, dl);
    EXPECT_TRUE(near(to_vector(analytic),
                     weft::testing::derivative([&](const VecX& t) { return moved(t[0]).first; },
                                               zero, one, 3e-4)))
        << "parameter " << p;
    EXPECT_TRUE(
        near(to_vector(law.stress_derivative(p, rest.weight(), strain.value(), change.value())),
             weft::testing::derivative([&](const VecX& t) { return moved(t[0]).second; }, zero, one,
                                       3e-4)))
        << "parameter " << p;
  }
}

}  // namespace
}  // namespace weft::xpbd::xpbd_constraints_test
