/// Forces and exact Hessians of single elements against dual numbers: the energy from the
/// definitions of the strains (common/dual_strains.h), differentiated automatically. 1e-12 of the
/// largest entry, as in the strains' test.
#include <gtest/gtest.h>

#include <numbers>

#include "common/dual_strains.h"
#include "common/energy_battery.h"
#include "weft/base/dense.h"
#include "weft/base/random.h"
#include "weft/model/cloth_model.h"

namespace weft::dual_number_test {
namespace {

using testing::DualVector;
using testing::near;
using testing::point_of;

constexpr double kDigits = 1e-12;
constexpr double kDensity = 0.15;
const Vec3 kGravity(0.4, -0.3, -9.81);

Points points(const VecX& x) { return Eigen::Map<const Points>(x.data(), 3, x.size() / 3); }

TriangleMesh one_triangle() {
  TriangleMesh mesh;
  mesh.material.resize(2, 3);
  mesh.material << 0.10, 0.123, 0.108, 0.20, 0.204, 0.221;
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}

/// A triangle cut at the middles of its edges: 0, 1, 2 are the inner one, so that its three
/// neighbours are of its shape; a piece of a lattice, where twist needs no factor.
TriangleMesh four_triangles() {
  const TriangleMesh inner = one_triangle();
  TriangleMesh mesh;
  mesh.material.resize(2, 6);
  mesh.material.leftCols<3>() = inner.material;
  for (int j = 0; j < 3; ++j)
    mesh.material.col(3 + j) =
        inner.material.col(j) + inner.material.col((j + 1) % 3) - inner.material.col((j + 2) % 3);
  mesh.triangles = {{0, 1, 2}, {1, 0, 3}, {2, 1, 4}, {0, 2, 5}};
  return mesh;
}

Fabric fabric_with(const std::vector<std::string>& parameters) {
  Fabric fabric = Fabric::with_defaults("test");
  for (const ParameterInfo& p : baraff_witkin_parameters()) {
    const std::string name(p.name);
    const bool wanted = std::find(parameters.begin(), parameters.end(), name) != parameters.end();
    double value = 0;
    if (wanted && name.ends_with("stiffness")) value = name == "bend_stiffness" ? 3e-4 : 70;
    if (wanted && name.ends_with("damping")) value = name == "bend_damping" ? 2e-5 : 0.4;
    if (name == "shear_stiffness") value *= 0.6;
    // Not set(): zero lies outside the range of a stiffness.
    fabric.values[parameter_index(fabric.model, name)] = value;
  }
  return fabric;
}

/// Strains of a mesh from their definitions: stretch u, v and shear, then three curvatures of each
/// triangle.
class Reference {
 public:
  explicit Reference(const TriangleMesh& mesh) : mesh_(mesh) {
    for (const auto& t : mesh.triangles) {
      std::array<Vec2, 3> p;
      for (std::size_t j = 0; j < 3; ++j) p[j] = mesh.material.col(t[j]);
      const Vec2 a = p[1] - p[0], b = p[2] - p[0];
      corners_.push_back(p);
      areas_.push_back(0.5 * std::abs(a.x() * b.y() - a.y() * b.x()));
      find_hinges(t, testing::curvature_by_angle(p));
    }
  }

  template <class T>
  std::vector<T> strains(const std::vector<T>& x) const {
    std::vector<T> c;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto w = testing::thread_vectors<T>(corners_[t], corners(mesh_.triangles[t], x));
      c.insert(c.end(), {length(w[0]) - 1.0, length(w[1]) - 1.0, dot(w[0], w[1])});
    }
    for (const Bend& bend : bends_) {
      std::vector<T> angles;
      for (const auto& h : bend.hinges) {
        if (h[3] < 0)
          angles.push_back(0.0);
        else
          angles.push_back(
              testing::hinge_angle(at(x, h[0]), at(x, h[1]), at(x, h[2]), at(x, h[3])));
      }
      for (Eigen::Index k = 0; k < 3; ++k)
        c.push_back(bend.map(k, 0) * angles[0] + bend.map(k, 1) * angles[1] +
                    bend.map(k, 2) * angles[2]);
    }
    return c;
  }
  double area(std::size_t component) const { return areas_[component / 3 % areas_.size()]; }
  double stiffness(const Fabric& fabric, std::size_t component, const char* kind) const {
    const bool bend = component >= 3 * areas_.size(), shear = component % 3 == 2;
    return fabric.value(std::string(bend ? "bend" : shear ? "shear" : "stretch") + kind);
  }

 private:
  struct Bend {
    Mat3 map;
    std::array<std::array<int, 4>, 3> hinges;  // edge, apex, apex across; the last -1: rim
  };

  template <class T>
  static DualVector<T> at(const std::vector<T>& x, int vertex) {
    return point_of(x, static_cast<std::size_t>(vertex));
  }
  template <class T>
  static std::array<DualVector<T>, 3> corners(const std::array<int, 3>& t,
                                              const std::vector<T>& x) {
    return {at(x, t[0]), at(x, t[1]), at(x, t[2])};
  }

  /// A rim edge's angle takes the value of least energy: what its column spans is projected out.
  void find_hinges(const std::array<int, 3>& t, const Mat3& by_angle) {
    Bend bend{by_angle, {}};
    std::vector<Eigen::Index> rim;
    for (std::size_t j = 0; j < 3; ++j) {
      const int a = t[j], b = t[(j + 1) % 3], apex = t[(j + 2) % 3];
      int other = -1;
      for (const auto& n : mesh_.triangles) {
        int shared = 0, third = -1;
        for (const int v : n)
          (v == a || v == b ? shared : third) = v == a || v == b ? shared + 1 : v;
        if (shared == 2 && third != apex) other = third;
      }
      bend.hinges[j] = {a, b, apex, other};
      if (other < 0) rim.push_back(static_cast<Eigen::Index>(j));
    }
    if (!rim.empty()) {
      const MatX free = by_angle(Eigen::all, rim);
      bend.map -= free * least_squares_solution(free, bend.map);
      for (const Eigen::Index j : rim) bend.map.col(j).setZero();
    }
    bends_.push_back(bend);
  }

  TriangleMesh mesh_;
  std::vector<std::array<Vec2, 3>> corners_;
  std::vector<double> areas_;
  std::vector<Bend> bends_;
};

/// Lightly and strongly deformed, squeezed to a hundredth along u, sheared until the threads are
/// nearly parallel, folded over.
std::vector<VecX> states(const TriangleMesh& mesh) {
  Rng rng(31);
  const auto state = [&](const Eigen::Matrix<double, 3, 2>& f, double noise) {
    Points x = f * mesh.material;
    for (double& c : x.reshaped()) c += 0.02 * noise * rng.normal();
    return VecX(flat(x));
  };
  Eigen::Matrix<double, 3, 2> plane, narrow, parallel;
  plane << 1, 0, 0, 1, 0, 0;
  narrow << 0.01, 0, 0, 1, 0, 0;
  parallel << 1, 0.999, 0, 0.03, 0, 0.03;
  return {state(plane, 0.01),  state(plane, 0.3),     state(0.5 * plane, 0.05),
          state(narrow, 0.02), state(parallel, 0.02), state(plane, 1)};
}

struct Case {
  const char* name;
  TriangleMesh mesh;
  std::vector<std::string> parameters;
};

std::vector<Case> cases() {
  return {{"stretch", one_triangle(), {"stretch_stiffness", "stretch_damping"}},
          {"shear", one_triangle(), {"shear_stiffness", "shear_damping"}},
          {"bend", four_triangles(), {"bend_stiffness", "bend_damping"}}};
}

TEST(DualNumbers, StrainsOfAMesh) {
  for (const Case& c : cases()) {
    const ClothModel model(c.mesh, fabric_with(c.parameters), kDensity, kGravity);
    const Reference reference(c.mesh);
    for (const VecX& x : states(c.mesh)) {
      VecX found;
      model.strains(points(x), found);
      std::vector<testing::Dual1> at;
      for (const double coordinate : x) at.emplace_back(coordinate);
      const auto values = reference.strains(at);
      ASSERT_EQ(std::size_t(found.size()), values.size());
      VecX expected(found.size());
      for (Eigen::Index i = 0; i < found.size(); ++i)
        expected[i] = double(values[std::size_t(i)].value);
      EXPECT_TRUE(near(found.head(found.size() / 2), expected.head(found.size() / 2), kDigits, 1));
      EXPECT_TRUE(near(found.tail(found.size() / 2), expected.tail(found.size() / 2), kDigits, 1));
    }
  }
}

// Energy 1/2 A k C^2 + 1/2 A kd (rate C - history)^2 / rate; elastic alone where the rate is 0.
TEST(DualNumbers, GradientAndExactHessianOfThePotential) {
  Rng rng(32);
  for (const Case& c : cases())
    for (const double rate : {0.0, 180.0})
      for (const VecX& x : states(c.mesh)) {
        const Fabric fabric = fabric_with(c.parameters);
        const ClothModel model(c.mesh, fabric, kDensity, Vec3::Zero());
        const Reference reference(c.mesh);
        VecX history(model.component_count());
        for (double& h : history) h = 20 * rng.normal();
        const auto potential = [&](const auto& v) {
          const auto strains = reference.strains(v);
          std::decay_t<decltype(v[0])> sum = 0.0;
          for (std::size_t i = 0; i < strains.size(); ++i) {
            const double area = reference.area(i);
            sum = sum + 0.5 * area * reference.stiffness(fabric, i, "_stiffness") * strains[i] *
                            strains[i];
            if (rate == 0) continue;
            const auto speed = rate * strains[i] - history[Eigen::Index(i)];
            sum = sum +
                  (0.5 * area * reference.stiffness(fabric, i, "_damping") / rate) * speed * speed;
          }
          return sum;
        };
        const testing::ScalarDerivatives expected = testing::differentiate(potential, x);
        const DampingRate damping{rate, rate > 0 ? &history : nullptr};
        Points gradient;
        SparseMatrix hessian = model.hessian_pattern();
        model.potential_hessian(points(x), damping, HessianKind::exact, gradient, hessian);
        EXPECT_NEAR(model.potential(points(x), damping), expected.value,
                    kDigits * std::abs(expected.value))
            << c.name;
        EXPECT_TRUE(near(flat(gradient), expected.gradient, kDigits)) << c.name << rate;
        EXPECT_TRUE(near(testing::from_lower(hessian), expected.hessian, kDigits))
            << c.name << rate;
      }
}

// f = - sum A (k C + kd grad C . v) grad C + m g.
TEST(DualNumbers, ForcesOfElasticityAndDamping) {
  Rng rng(33);
  for (const Case& c : cases())
    for (const VecX& x : states(c.mesh)) {
      const Fabric fabric = fabric_with(c.parameters);
      const ClothModel model(c.mesh, fabric, kDensity, kGravity);
      const Reference reference(c.mesh);
      VecX v(x.size());
      for (double& speed : v) speed = rng.normal();
      const auto strains = [&](const auto& y) { return reference.strains(y); };
      const MatX gradients = testing::dual_jacobian(strains, x);
      VecX values;
      model.strains(points(x), values);
      const VecX rates = gradients * v;
      VecX expected = flat(Points(kGravity * model.masses().transpose()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        const auto k = std::size_t(i);
        expected -= reference.area(k) *
                    (reference.stiffness(fabric, k, "_stiffness") * values[i] +
                     reference.stiffness(fabric, k, "_damping") * rates[i]) *
                    gradients.row(i).transpose();
      }
      Points force;
      model.forces(points(x), points(v), force);
      EXPECT_TRUE(near(flat(force), expected, kDigits)) << c.name;
    }
}

/// Force on each vertex of a triangle from positions (first nine) and velocities: -A / 3 times
/// k_N s |s| / (1 + k_f s^2) along the normal and k_T (velocity - s normal) along the surface.
struct DragReference {
  double tangential, normal, degradation, area;
  template <class T>
  std::vector<T> operator()(const std::vector<T>& state) const {
    const auto p = [&](std::size_t i) { return point_of(state, i); };
    const DualVector<T> across = cross(p(1) - p(0), p(2) - p(0));
    const DualVector<T> n = (T(1.0) / length(across)) * across;
    const DualVector<T> mean = (T(1.0) / T(3.0)) * (p(3) + p(4) + p(5));
    const T s = dot(mean, n);
    const T pressure = normal * s * abs(s) / (1.0 + degradation * s * s);
    const DualVector<T> f = (T(-area) / T(3.0)) * (pressure * n + T(tangential) * (mean - s * n));
    return {f.x, f.y, f.z};
  }
};

TEST(DualNumbers, DragAndItsDerivatives) {
  const TriangleMesh mesh = one_triangle();
  Fabric fabric = Fabric::with_defaults("test");
  fabric.set("drag_linear", 0.4);
  fabric.set("drag_quadratic", 0.9);
  fabric.set("drag_degradation", 0.3);
  const ClothModel model(mesh, fabric, kDensity, Vec3::Zero());
  const DragReference reference{0.4, 0.9, 0.3, material_area(mesh, 0)};
  Rng rng(34);
  for (const VecX& x : states(mesh))
    for (const double speed : {0.05, 1.0, 8.0}) {
      VecX state(18);
      state.head(9) = x;
      for (double& v : state.tail(9)) v = speed * rng.normal();
      const VecX v = state.tail(9);
      std::vector<testing::Dual1> at;
      for (const double coordinate : state) at.emplace_back(coordinate);
      const auto values = reference(at);
      Points force = Points::Zero(3, 3);
      model.add_drag(points(x), points(v), force);
      for (int i = 0; i < 9; ++i)
        EXPECT_NEAR(force(i % 3, i / 3), double(values[std::size_t(i % 3)].value),
                    kDigits * force.cwiseAbs().maxCoeff());

      const MatX jacobian = testing::dual_jacobian(reference, state);
      DragJacobian drag;
      model.drag_jacobian(points(x), points(v), drag);
      ASSERT_EQ(drag.groups.size(), 1u);
      const DragJacobian::Group& group = drag.groups[0];
      const auto first_lane = [](const Matrix3<Lanes>& lanes) {
        Mat3 m;
        for (std::size_t i = 0; i < 9; ++i)
          m(Eigen::Index(i / 3), Eigen::Index(i % 3)) = lanes.m[i][0];
        return m;
      };
      const double third = 1.0 / 3;  // the share of each vertex
      for (std::size_t j = 0; j < 3; ++j) {
        EXPECT_EQ(group.shares[j][0], third);
        const auto vertex = static_cast<Eigen::Index>(group.vertices[j][0]);
        EXPECT_TRUE(near(third * first_lane(group.by_position[j]),
                         jacobian.middleCols<3>(3 * vertex), kDigits,
                         jacobian.leftCols(9).cwiseAbs().maxCoeff()));
        EXPECT_TRUE(near(third * third * first_lane(group.by_velocity),
                         jacobian.middleCols<3>(9 + 3 * vertex), kDigits));
      }
      SparseMatrix damping = model.hessian_pattern();
      model.add_drag_damping(points(x), points(v), 2.5, damping);
      MatX expected(9, 9);
      for (int i = 0; i < 3; ++i) expected.middleRows<3>(3 * i) = -2.5 * jacobian.rightCols(9);
      EXPECT_TRUE(near(testing::from_lower(damping), expected, kDigits));
    }
}

}  // namespace
}  // namespace weft::dual_number_test
