#include "weft/model/cloth_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/cloth_battery.h"
#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/model/bending.h"
#include "weft/strain/dihedral_angle.h"
#include "weft/strain/shear.h"
#include "weft/strain/stretch.h"

namespace weft::cloth_model_test {
namespace {

using testing::Energy;
using testing::flat_positions;
using testing::near;
using testing::points;
using testing::potential_of;
using testing::random_points;
using testing::test_fabric;
using testing::vector;

constexpr double kSize = 0.02;  // m, edge of a grid cell in most tests
const Vec3 kNoGravity = Vec3::Zero();

TriangleMesh small_mesh(GridPattern pattern = GridPattern::alternating) {
  return make_swatch(3 * kSize, 2 * kSize, 4, 3, pattern);
}

/// States that a simulation meets, and some that it should not: lightly bent, strongly deformed,
/// compressed to half, sheared, folded.
std::vector<Points> states(const TriangleMesh& mesh) {
  Rng rng(11);
  const Points flat_x = flat_positions(mesh);
  std::vector<Points> out;
  out.push_back(flat_x + random_points(rng, mesh.vertex_count(), 0.02 * kSize));
  out.push_back(flat_x + random_points(rng, mesh.vertex_count(), 0.25 * kSize));
  Points squeezed = 0.5 * flat_x + random_points(rng, mesh.vertex_count(), 0.02 * kSize);
  out.push_back(squeezed);
  Points sheared = flat_x + random_points(rng, mesh.vertex_count(), 0.05 * kSize);
  sheared.row(0) += 0.7 * sheared.row(1);
  out.push_back(sheared);
  Points folded = flat_x + random_points(rng, mesh.vertex_count(), 0.05 * kSize);
  for (int i = 0; i < folded.cols(); ++i)
    if (folded(0, i) > 1.5 * kSize) {
      folded(2, i) += 0.4 * kSize;
      folded(0, i) = 3 * kSize - folded(0, i);
    }
  out.push_back(folded);
  return out;
}

TEST(ClothModel, NoForceAndNoEnergyAtRest) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  const Points x = flat_positions(mesh);
  Points force;
  model.forces(x, Points::Zero(3, x.cols()), force);
  EXPECT_LT(force.cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT(model.elastic_energy(x), 1e-28);
  VecX c;
  model.strains(x, c);
  EXPECT_EQ(c.size(), model.component_count());
  EXPECT_LT(c.cwiseAbs().maxCoeff(), 1e-14);
}

TEST(ClothModel, DerivativesOfTheElasticPotential) {
  for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
    const TriangleMesh mesh = small_mesh(pattern);
    const ClothModel model(mesh, test_fabric(), 0.2, Vec3(0.3, -0.2, -9.81));
    const Energy energy = potential_of(model, {});
    for (const Points& x : states(mesh)) {
      testing::expect_gradient(energy, vector(x), 1e-3 * kSize);
      testing::expect_hessian(energy, vector(x), 1e-3 * kSize);
    }
  }
}

TEST(ClothModel, DerivativesWhereAnElementHasAVertexTwice) {
  const TriangleMesh mesh = testing::three_triangles(kSize);
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  const Energy energy = potential_of(model, {});
  for (const Points& x : states(mesh)) testing::expect_hessian(energy, vector(x), 1e-3 * kSize);
}

TEST(ClothModel, DerivativesOfTheDampingPotential) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  Rng rng(3);
  for (const Points& x : states(mesh)) {
    VecX history;
    model.strains(x + random_points(rng, static_cast<int>(x.cols()), 0.1 * kSize), history);
    history *= 200;
    const Energy energy = potential_of(model, {200, &history});
    testing::expect_gradient(energy, vector(x), 1e-3 * kSize);
    testing::expect_hessian(energy, vector(x), 1e-3 * kSize);
    testing::expect_positive_semidefinite(energy.projected_hessian(vector(x)));
  }
}

TEST(ClothModel, RigidMotionCostsNothing) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  for (const Points& x : states(mesh))
    testing::expect_rigid_invariance(potential_of(model, {}), vector(x));
}

TEST(ClothModel, ProjectedHessianHasNoNegativeEigenvalue) {
  const TriangleMesh mesh = small_mesh();
  Rng rng(7);
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  const Energy energy = potential_of(model, {});
  bool indefinite = false;
  for (const Points& x : states(mesh)) {
    testing::expect_positive_semidefinite(energy.projected_hessian(vector(x)));
    const VecX exact = symmetric_eigen(energy.hessian(vector(x))).values;
    indefinite |= exact.minCoeff() < -1e-3 * exact.maxCoeff();
  }
  EXPECT_TRUE(indefinite) << "the states do not exercise the projection";
}

/// The same sums from the strain headers, one element at a time, without lanes or precomputed
/// slots.
struct Reference {
  double energy = 0;
  VecX gradient;
  MatX hessian;

  Reference(const TriangleMesh& mesh, const Fabric& f, const Points& x) {
    gradient = VecX::Zero(3 * mesh.vertex_count());
    hessian = MatX::Zero(gradient.size(), gradient.size());
    const double stretch = f.value("stretch_stiffness"), shear = f.value("shear_stiffness");
    for (const auto& t : mesh.triangles) {
      const auto shape =
          triangle_shape(mesh.material.col(t[0]), mesh.material.col(t[1]), mesh.material.col(t[2]));
      const Vec3 a = x.col(t[0]), b = x.col(t[1]), c = x.col(t[2]);
      add(stretch_strain(shape, Thread::weft, a, b, c), stretch * shape.area, t);
      add(stretch_strain(shape, Thread::warp, a, b, c), stretch * shape.area, t);
      add(shear_strain(shape, a, b, c), shear * shape.area, t);
    }
    const double bend = f.value("bend_stiffness"), twist = f.value("twist_stiffness");
    for (const BendingElement& element : bending_elements(mesh))
      for (std::size_t i = 0; i < 3; ++i)
        add(curvature(element, element.map.r[i], x), (i < 2 ? bend : twist) * element.area,
            element.vertices);
  }

  struct Strain18 {
    double value = 0;
    VecX gradient = VecX::Zero(18);
    MatX hessian = MatX::Zero(18, 18);
  };

  /// A curvature component from the three dihedral angles, in the coordinates of the six vertices.
  static Strain18 curvature(const BendingElement& element, const std::array<double, 3>& row,
                            const Points& x) {
    Strain18 out;
    for (std::size_t j = 0; j < 3; ++j) {
      const std::array<std::size_t, 4> local = {j, (j + 1) % 3, (j + 2) % 3, 3 + j};
      std::array<Vec3, 4> p;
      for (std::size_t i = 0; i < 4; ++i) p[i] = x.col(element.vertices[local[i]]);
      const HingeStrain angle = dihedral_angle_strain(p[0], p[1], p[2], p[3]);
      out.value += row[j] * angle.value;
      for (std::size_t i = 0; i < 4; ++i) {
        const auto at = static_cast<Eigen::Index>(3 * local[i]);
        const auto from = static_cast<Eigen::Index>(3 * i);
        out.gradient.segment<3>(at) += row[j] * angle.gradient.segment<3>(from);
        for (std::size_t k = 0; k < 4; ++k)
          out.hessian.block<3, 3>(at, static_cast<Eigen::Index>(3 * local[k])) +=
              row[j] * angle.hessian.block<3, 3>(from, static_cast<Eigen::Index>(3 * k));
      }
    }
    return out;
  }

  template <class Strain, class Vertices>
  void add(const Strain& s, double k, const Vertices& v) {
    energy += 0.5 * k * s.value * s.value;
    const VecX g = k * s.value * s.gradient;
    const MatX h = k * (s.gradient * s.gradient.transpose() + s.value * s.hessian);
    for (std::size_t i = 0; i < v.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(3 * i);
      gradient.segment<3>(3 * v[i]) += g.segment<3>(row);
      for (std::size_t j = 0; j < v.size(); ++j)
        hessian.block<3, 3>(3 * v[i], 3 * v[j]) +=
            h.block<3, 3>(row, static_cast<Eigen::Index>(3 * j));
    }
  }
};

TEST(ClothModel, AgreesWithTheSumOverTheElements) {
  Rng rng(5);
  // From one triangle up: full and partly filled groups of lanes, and no hinge at all.
  for (int count = 1; count <= 12; ++count) {
    TriangleMesh mesh = small_mesh();
    mesh.triangles.resize(static_cast<std::size_t>(count));
    int used = 0;
    for (const auto& t : mesh.triangles) used = std::max({used, t[0] + 1, t[1] + 1, t[2] + 1});
    std::vector<int> index(static_cast<std::size_t>(used), -1);
    TriangleMesh part;
    part.material.resize(2, used);
    int n = 0;
    for (auto t : mesh.triangles) {
      for (int& v : t) {
        int& place = index[static_cast<std::size_t>(v)];
        if (place < 0) part.material.col(place = n++) = mesh.material.col(v);
        v = place;
      }
      part.triangles.push_back(t);
    }
    part.material.conservativeResize(2, n);
    const Fabric fabric = test_fabric();
    const ClothModel model(part, fabric, 0.2, kNoGravity);
    const Points x = flat_positions(part) + random_points(rng, n, 0.2 * kSize);
    const Reference expected(part, fabric, x);
    const Energy energy = potential_of(model, {});
    // Rounding of a few dozen terms.
    EXPECT_NEAR(model.elastic_energy(x), expected.energy, 1e-13 * expected.energy);
    EXPECT_TRUE(near(energy.gradient(vector(x)), expected.gradient, 1e-12));
    EXPECT_TRUE(near(energy.hessian(vector(x)), expected.hessian, 1e-12));
  }
}

TEST(ClothModel, PatternIsTheLowerTriangleAndIsAddedTo) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  SparseMatrix h = model.hessian_pattern();
  EXPECT_TRUE(h.isCompressed());
  EXPECT_EQ(h.rows(), 3 * model.vertex_count());
  EXPECT_EQ(h.coeffs().abs().maxCoeff(), 0);
  for (int column = 0; column < h.cols(); ++column) {
    const int slot = model.diagonal_slots()[static_cast<std::size_t>(column)];
    EXPECT_EQ(slot, h.outerIndexPtr()[column]) << "the diagonal is the first entry";
    EXPECT_EQ(h.innerIndexPtr()[slot], column);
  }
  const Points x = states(mesh)[1];
  Points gradient, gradient_alone;
  model.potential_hessian(x, {}, HessianKind::exact, gradient, h);
  const VecX once = h.coeffs();
  model.potential_hessian(x, {}, HessianKind::exact, gradient, h);
  EXPECT_TRUE(near(VecX(h.coeffs()), 2 * once, 1e-14));
  model.potential_gradient(x, {}, gradient_alone);
  EXPECT_TRUE(near(gradient, gradient_alone, 1e-14));
}

TEST(ClothModel, ProjectionKeepsTheExactHessianUnderTension) {
  // Stretched in both directions nothing is indefinite, so that Newton converges quadratically.
  const TriangleMesh mesh = small_mesh();
  Fabric fabric = test_fabric();
  fabric.set("bend_stiffness", 1e-7);
  const ClothModel model(mesh, fabric, 0.2, kNoGravity);
  Rng rng(6);
  Points x = 1.05 * flat_positions(mesh) + random_points(rng, mesh.vertex_count(), 2e-3 * kSize);
  x.row(2).setZero();  // flat: bending has no second derivative to drop
  const Energy energy = potential_of(model, {});
  EXPECT_TRUE(near(energy.projected_hessian(vector(x)), energy.hessian(vector(x)), 1e-13));
}

TEST(ClothModel, CollapsedStatesAreFinite) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, Vec3(0, 0, -9.81));
  Points line = flat_positions(mesh);
  line.row(1).setZero();  // all triangles without area
  Points pinched = flat_positions(mesh);
  pinched.col(5) = pinched.col(6);  // two vertices in one place
  for (const Points& x : {Points(Points::Zero(3, mesh.vertex_count())), line, pinched}) {
    Points v = Points::Constant(3, x.cols(), 0.3), force;
    model.forces(x, v, force);
    EXPECT_TRUE(force.allFinite());
    EXPECT_TRUE(std::isfinite(model.potential(x, {})));
    const Energy energy = potential_of(model, {});
    EXPECT_TRUE(energy.hessian(vector(x)).allFinite());
    testing::expect_positive_semidefinite(energy.projected_hessian(vector(x)));
    SparseMatrix h = model.hessian_pattern();
    model.add_drag_damping(x, v, 1, h);
    testing::expect_positive_semidefinite(testing::from_lower(h));
  }
}

/// Homogeneous deformation by `f` (columns w_u, w_v).
Points homogeneous(const TriangleMesh& mesh, const Eigen::Matrix<double, 3, 2>& f) {
  return f * mesh.material;
}

TEST(ClothModel, HomogeneousDeformationHasTheSameEnergyOnEveryMesh) {
  const Fabric fabric = test_fabric();
  Eigen::Matrix<double, 3, 2> f;
  f << 1.1, 0.2, -0.1, 0.9, 0.3, 0.4;
  const double width = 0.06, height = 0.04;
  const double cu = f.col(0).norm() - 1, cv = f.col(1).norm() - 1, cs = f.col(0).dot(f.col(1));
  const double expected = 0.5 * width * height *
                          (fabric.value("stretch_stiffness") * (cu * cu + cv * cv) +
                           fabric.value("shear_stiffness") * cs * cs);
  for (const int n : {2, 3, 4, 7, 13})
    for (const GridPattern pattern : {GridPattern::alternating, GridPattern::uniform}) {
      TriangleMesh mesh = make_swatch(width, height, n, n + 1, pattern);
      Rng rng(static_cast<std::uint64_t>(n));
      for (int i = 1; i + 1 < n; ++i)  // inner vertices moved on the fabric: irregular triangles
        mesh.material.col(n + i) += 0.2 * width / n * Vec2(rng.uniform(-1, 1), rng.uniform(-1, 1));
      const ClothModel model(mesh, fabric, 0.2, kNoGravity);
      EXPECT_NEAR(model.elastic_energy(homogeneous(mesh, f)), expected, 1e-13 * expected);
    }
}

TEST(ClothModel, MassesAndGravity) {
  const TriangleMesh mesh = make_swatch(0.3, 0.2, 5, 4);
  const Vec3 g(0.5, -1, -9.81);
  const ClothModel model(mesh, test_fabric(), 0.25, g);
  EXPECT_NEAR(model.masses().sum(), 0.25 * 0.3 * 0.2, 1e-16);
  const Points x = flat_positions(mesh);
  // The centre of mass is the middle of the swatch.
  EXPECT_NEAR(model.gravity_energy(x), -0.015 * g.dot(Vec3(0.15, 0.1, 0)), 1e-15);
  EXPECT_NEAR(model.potential(x, {}), model.gravity_energy(x), 1e-15);
  Points force;
  model.forces(x, Points::Zero(3, x.cols()), force);
  EXPECT_TRUE(near(force, g * model.masses().transpose(), 1e-12));
}

/// d strains / dt under velocities v, by differences.
VecX numeric_strain_rates(const ClothModel& model, const Points& x, const Points& v) {
  const auto strains = [&](const VecX& y) {
    VecX c;
    model.strains(points(y), c);
    return c;
  };
  return testing::derivative(strains, vector(x), vector(v), 1e-3 * kSize / v.cwiseAbs().maxCoeff());
}

TEST(ClothModel, ForcesAreThePotentialsGradientWithTheStrainRateOfTheVelocities) {
  const TriangleMesh mesh = small_mesh();
  Fabric fabric = test_fabric();
  for (const char* name : {"drag_linear", "drag_quadratic", "drag_normal_linear"})
    fabric.set(name, 0);
  const ClothModel model(mesh, fabric, 0.2, Vec3(0, 0, -9.81));
  Rng rng(8);
  for (const Points& x : states(mesh)) {
    const Points v = random_points(rng, static_cast<int>(x.cols()), 1);
    VecX c;
    model.strains(x, c);
    const double rate = 150;
    const VecX history = rate * c - numeric_strain_rates(model, x, v);
    Points force, gradient;
    model.forces(x, v, force);
    model.potential_gradient(x, {rate, &history}, gradient);
    EXPECT_TRUE(near(-gradient, force));
  }
}

TEST(ClothModel, DampingTakesPower) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  Rng rng(9);
  for (const Points& x : states(mesh)) {
    const Points v = random_points(rng, static_cast<int>(x.cols()), 1);
    Points with, without;
    model.forces(x, v, with);
    model.forces(x, Points::Zero(3, x.cols()), without);
    const double power = model.damping_power(x, v) + model.drag_power(x, v);
    EXPECT_NEAR(power, -((with - without).cwiseProduct(v)).sum(), 1e-11 * power);
    EXPECT_GT(model.damping_power(x, v), 0);
    EXPECT_GT(model.drag_power(x, v), 0);
    // A rigid motion is not damped.
    Points rigid(3, x.cols());
    for (int i = 0; i < x.cols(); ++i)
      rigid.col(i) = Vec3(0.1, 0.2, -0.3) + Vec3(1, -2, 0.5).cross(Vec3(x.col(i)));
    EXPECT_LT(model.damping_power(x, rigid), 1e-20);
  }
}

TEST(ClothModel, DragOfAFlatSwatch) {
  const TriangleMesh mesh = make_swatch(0.3, 0.2, 4, 5);
  const Fabric fabric = test_fabric();
  const ClothModel model(mesh, fabric, 0.2, kNoGravity);
  const Points x = flat_positions(mesh);
  const double area = 0.06;
  const auto total = [&](const Vec3& velocity) {
    Points force = Points::Zero(3, x.cols());
    model.add_drag(x, velocity.replicate(1, x.cols()), force);
    return Vec3(force.rowwise().sum());
  };
  const double kt = fabric.value("drag_linear"), kn = fabric.value("drag_quadratic"),
               kf = fabric.value("drag_degradation"), kl = fabric.value("drag_normal_linear");
  const double s = 1.7;
  EXPECT_LT((total({s, 0, 0}) - Vec3(-area * kt * s, 0, 0)).norm(), 1e-15);
  EXPECT_LT((total({0, 0, -s}) - Vec3(0, 0, area * (kl + kn * s / (1 + kf * s * s)) * s)).norm(),
            1e-15);
  EXPECT_LT((total({s, 0, -s}) - total({s, 0, 0}) - total({0, 0, -s})).norm(), 1e-15);
  // At high speed the quadratic part of the normal drag tends to k_N / k_f per area, from below.
  const auto quadratic = [&](double speed) {
    return -total({0, 0, speed}).z() - area * kl * speed;
  };
  EXPECT_NEAR(quadratic(1e4), area * kn / kf, 1e-6 * area * kn / kf);
  EXPECT_LT(quadratic(1e2), quadratic(1e3));
  EXPECT_LT(quadratic(1e4), area * kn / kf);
}

TEST(ClothModel, DragOpposesMotion) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  Rng rng(10);
  for (const Points& x : states(mesh)) {
    const Points v = random_points(rng, static_cast<int>(x.cols()), 2);
    Points drag = Points::Zero(3, x.cols());
    model.add_drag(x, v, drag);
    EXPECT_LT(drag.cwiseProduct(v).sum(), 0);
    EXPECT_NEAR(-drag.cwiseProduct(v).sum(), model.drag_power(x, v), 1e-13);
  }
}

TEST(ClothModel, DragDampingIsTheDerivativeByVelocity) {
  const TriangleMesh mesh = small_mesh();
  const ClothModel model(mesh, test_fabric(), 0.2, kNoGravity);
  Rng rng(12);
  for (const Points& x : states(mesh)) {
    const Points v = random_points(rng, static_cast<int>(x.cols()), 2);
    const auto drag = [&](const VecX& w) {
      Points force = Points::Zero(3, x.cols());
      model.add_drag(x, points(w), force);
      return vector(force);
    };
    SparseMatrix h = model.hessian_pattern();
    const double factor = 0.7;
    model.add_drag_damping(x, v, factor, h);
    const MatX damping = testing::from_lower(h);
    // The law has a kink in its second derivative at zero normal speed; steps are small against 2.
    EXPECT_TRUE(near(damping, -factor * testing::numeric_jacobian(drag, vector(v), 1e-4)));
    testing::expect_positive_semidefinite(damping);
  }
}

TEST(ClothModel, ForceDerivativeByEachParameter) {
  const TriangleMesh mesh = small_mesh();
  const Fabric fabric = test_fabric();
  const ClothModel model(mesh, fabric, 0.2, Vec3(0, 0, -9.81));
  Rng rng(13);
  const Points x = states(mesh)[1], v = random_points(rng, mesh.vertex_count(), 1);
  ClothModel varied(mesh, fabric, 0.2, Vec3(0, 0, -9.81));
  const auto forces = [&](const VecX& parameters) {
    Fabric f = fabric;
    f.values = parameters;
    varied.set_fabric(f);
    Points force;
    varied.forces(x, v, force);
    return vector(force);
  };
  for (int i = 0; i < fabric.values.size(); ++i) {
    Points analytic;
    model.force_derivative(x, v, i, analytic);
    const VecX direction = VecX::Unit(fabric.values.size(), i);
    const double step = 0.05 * fabric.values[i];
    const VecX numeric = testing::derivative(forces, fabric.values, direction, step);
    // Rounding: forces of all parameters together, divided by the step.
    const double floor =
        forces(fabric.values).cwiseAbs().maxCoeff() / step * 1e-14 / testing::kTolerance;
    EXPECT_TRUE(near(vector(analytic), numeric, 1e-6, floor)) << i;
    EXPECT_GT(analytic.cwiseAbs().maxCoeff(), 0) << i;
  }
}

TEST(ClothModel, TwistLeftOutIsBend) {
  const TriangleMesh mesh = small_mesh();
  Fabric without = test_fabric();
  without.leave_out("twist_stiffness");
  Fabric with = without;
  with.include("twist_stiffness");
  ClothModel model(mesh, without, 0.2, kNoGravity);
  const Points x = states(mesh)[1];
  const double energy = model.elastic_energy(x);
  Points by_bend, by_twist;
  model.force_derivative(x, Points::Zero(3, x.cols()), without.value_index("bend_stiffness"),
                         by_bend);
  model.set_fabric(with);
  EXPECT_EQ(model.elastic_energy(x), energy);
  Points by_bend_alone;
  model.force_derivative(x, Points::Zero(3, x.cols()), with.value_index("bend_stiffness"),
                         by_bend_alone);
  model.force_derivative(x, Points::Zero(3, x.cols()), with.value_index("twist_stiffness"),
                         by_twist);
  EXPECT_TRUE(near(by_bend_alone + by_twist, by_bend, 1e-12));
  with.set("twist_stiffness", 2 * with.value("twist_stiffness"));
  model.set_fabric(with);
  EXPECT_GT(model.elastic_energy(x), energy);
}

TEST(ClothModel, RejectsWhatIsNotAFabricOrAMesh) {
  const TriangleMesh mesh = small_mesh();
  const Fabric fabric = test_fabric();
  for (const double density : {0.0, -1.0, 101.0, std::nan("")})
    EXPECT_THROW(ClothModel(mesh, fabric, density, kNoGravity), Error);
  TriangleMesh clockwise = mesh;
  std::swap(clockwise.triangles[0][0], clockwise.triangles[0][1]);
  EXPECT_THROW(ClothModel(clockwise, fabric, 0.2, kNoGravity), Error);
  ClothModel model(mesh, fabric, 0.2, kNoGravity);
  Fabric bad = fabric;
  bad.values[2] = std::nan("");
  EXPECT_THROW(model.set_fabric(bad), Error);
  bad = fabric;
  bad.values[2] = -1;
  EXPECT_THROW(model.set_fabric(bad), Error);
  bad = fabric;
  bad.values.conservativeResize(8);
  EXPECT_THROW(model.set_fabric(bad), Error);
  bad = fabric;
  bad.model = "springs";
  EXPECT_THROW(model.set_fabric(bad), Error);
}

}  // namespace
}  // namespace weft::cloth_model_test
