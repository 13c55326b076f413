#include "weft/model/friction.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "common/elastic_battery.h"
#include "weft/base/error.h"
#include "weft/model/material_response.h"

namespace weft::friction_test {
namespace {

using detail::Friction;
using testing::flat_positions;
using testing::points;
using testing::vector;

constexpr double kSize = 0.02;  // m, edge of a grid cell

TEST(Friction, FollowsItsLawInSmallStepsAndInOne) {
  // ds/de = (f - s sign(de)) / c, integrated in 20000 steps of Heun's method.
  const Friction friction{3, 0.02};
  double s = -1.2, e = 0.01;
  const double end = 0.05, h = (end - e) / 20000;
  for (int i = 0; i < 20000; ++i) {
    const double k1 = (3 - s) / 0.02, k2 = (3 - (s + h * k1)) / 0.02;
    s += 0.5 * h * (k1 + k2);
  }
  EXPECT_NEAR(detail::respond(friction, end, e, -1.2).stress, s, 1e-7);
  // In two steps or in one it is the same; and back it is not.
  const double half = detail::respond(friction, 0.03, e, -1.2).stress;
  EXPECT_NEAR(detail::respond(friction, end, 0.03, half).stress, s, 1e-7);
  EXPECT_LT(detail::respond(friction, e, end, s).stress, -1.2);
}

TEST(Friction, Derivatives) {
  for (const double e : {0.035, 0.001}) {
    const auto at = [&](const VecX& v) { return detail::respond({v[1], v[2]}, v[0], 0.01, v[3]); };
    VecX x(4);
    x << e, 3, 0.02, -1.2;
    const auto energy = [&](const VecX& v) { return at(v).energy; };
    const auto stress = [&](const VecX& v) { return at(v).stress; };
    const auto r = at(x);
    EXPECT_NEAR(testing::derivative(energy, x, VecX::Unit(4, 0), 1e-4), r.stress, 1e-8);
    EXPECT_NEAR(testing::derivative(stress, x, VecX::Unit(4, 0), 1e-4), r.tangent, 1e-6);
    EXPECT_NEAR(testing::derivative(stress, x, VecX::Unit(4, 1), 1e-3), r.by_amplitude, 1e-8);
    EXPECT_NEAR(testing::derivative(stress, x, VecX::Unit(4, 2), 1e-4), r.by_scale, 1e-6);
    EXPECT_NEAR(testing::derivative(stress, x, VecX::Unit(4, 3), 1e-3), r.by_former_stress, 1e-8);
    EXPECT_GE(r.tangent, 0);
  }
}

TEST(Friction, ALoopTakesUpFourTimesAmplitudeTimesStrain) {
  // Between -E and E with E >> c the stress is +-f but for the reversals, where it loses 2 f c
  // each.
  const Friction friction{3, 0.002};
  double s = -3, e = -0.1, work = 0;
  const int n = 4000;
  for (int i = 1; i <= 2 * n; ++i) {
    const double next = i <= n ? -0.1 + 0.2 * i / n : 0.3 - 0.2 * i / n;
    const auto r = detail::respond(friction, next, e, s);
    work += r.energy;
    s = r.stress;
    e = next;
  }
  EXPECT_NEAR(work, 2 * 3 * 0.2 - 2 * 2 * 3 * 0.002, 1e-9);
}

Fabric rough(const std::string& model) {
  Fabric fabric = Fabric::with_defaults("rough", model);
  const auto set = [&](const std::string& component, double amplitude, double scale) {
    fabric.include(component + "_friction");
    fabric.include(component + "_friction_scale");
    fabric.set(component + "_friction", amplitude);
    fabric.set(component + "_friction_scale", scale);
  };
  const bool springs = model == "springs";
  if (model == "stvk")
    fabric.values.head(8) << 40, 15, 25, 12, 40e-4, 15e-4, 25e-4, 12e-4;
  else if (springs)
    fabric.values.head(6) << 40, 25, 12, 4, 2, 3;
  else if (model != "piecewise-linear")
    fabric.values.head(6) << 40, 25, 12, 4e-3, 2e-3, 3e-3;
  set("warp_stretch", 2, 0.05);
  set("shear", 1.5, 0.1);
  // Of sheets a moment over curvatures, of springs a force over elongations.
  set("weft_bend", springs ? 0.5 : 0.01, springs ? 0.03 : 10);
  return fabric;
}

/// History of a frame of a rough shape.
void start_from_a_frame(ElasticModel& model) {
  Rng rng(5);
  const Points x = flat_positions(model.mesh()) +
                   testing::random_points(rng, model.mesh().vertex_count(), 0.1 * kSize);
  model.set_history(model.next_history(x));
}

TEST(FrictionModel, EnergyAndDerivativesAtAHistory) {
  for (const char* name : {"stvk", "soft-constraints", "springs"}) {
    SCOPED_TRACE(name);
    const auto model = make_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3), rough(name));
    start_from_a_frame(*model);
    const testing::Energy energy = testing::energy_of(*model);
    for (const Points& x : testing::states(model->mesh(), kSize)) {
      testing::expect_gradient(energy, vector(x), 2e-5 * kSize);
      testing::expect_hessian(energy, vector(x), 2e-5 * kSize);
      testing::expect_rigid_invariance(energy, vector(x));
      testing::expect_positive_semidefinite(energy.projected_hessian(vector(x)));
      testing::expect_parameter_derivative(*model, x);
    }
  }
}

void expect_derivatives_along_with_the_history(const std::string& name) {
  SCOPED_TRACE(name);
  // Two frames at shapes that move with the parameters: total derivative of the second frame's
  // gradient against differences over the whole sequence.
  const Fabric fabric = rough(name);
  const auto model = make_elastic_model(make_swatch(3 * kSize, 2 * kSize, 4, 3), fabric);
  const auto shapes = testing::states(model->mesh(), kSize);
  const int p = static_cast<int>(fabric.values.size());
  Rng rng(8);
  std::vector<MatX> motion;
  for (int frame = 0; frame < 3; ++frame) {
    MatX m(shapes[0].size(), p);
    for (auto& value : m.reshaped()) value = 0.01 * kSize * rng.normal();
    m *= fabric.values.cwiseInverse().asDiagonal();
    motion.push_back(m);
  }
  const auto shape = [&](int frame, const VecX& values) -> Points {
    return points(vector(shapes[static_cast<std::size_t>(frame)]) +
                  motion[static_cast<std::size_t>(frame)] * (values - fabric.values));
  };
  const auto last_gradient = [&](const VecX& values) {
    model->set_parameters(values);
    model->set_history(VecX::Zero(model->history_size()));
    for (int frame = 0; frame < 2; ++frame)
      model->set_history(model->next_history(shape(frame, values)));
    Points g;
    model->gradient(shape(2, values), g);
    return vector(g);
  };
  last_gradient(fabric.values);
  model->set_history(VecX::Zero(model->history_size()));
  MatX history = MatX::Zero(model->history_size(), p);
  for (int frame = 0; frame < 2; ++frame) {
    const auto f = static_cast<std::size_t>(frame);
    history = model->next_history_derivative(shapes[f], motion[f], history);
    model->set_history(model->next_history(shapes[f]));
  }
  MatX derivative;
  model->parameter_derivative(shapes[2], derivative);
  model->add_history_derivative(shapes[2], history, derivative);
  SparseMatrix h = model->hessian_pattern();
  Points g;
  model->hessian(shapes[2], HessianKind::exact, g, h);
  derivative += testing::from_lower(h) * motion[2];
  for (int i = 0; i < p; ++i) {
    const VecX numeric = testing::derivative(last_gradient, fabric.values, VecX::Unit(p, i),
                                             1e-4 * fabric.values[i]);
    const double floor = 1e-3 * derivative.col(i).cwiseAbs().maxCoeff();
    EXPECT_TRUE(testing::near(derivative.col(i), numeric, 1e-6, floor)) << i;
  }
}

TEST(FrictionModel, DerivativesGoAlongWithTheHistory) {
  for (const char* name : {"stvk", "springs"}) expect_derivatives_along_with_the_history(name);
}

TEST(FrictionModel, ALoopOfAStripLiesTwoAmplitudesApart) {
  Fabric fabric = Fabric::with_defaults("strip", "soft-constraints");
  fabric.include("weft_stretch_friction");
  fabric.include("weft_stretch_friction_scale");
  fabric.set("weft_stretch_friction", 8);
  fabric.set("weft_stretch_friction_scale", 1e-3);
  const TriangleMesh mesh = make_swatch(0.1, 0.05, 5, 3);
  const auto model = make_elastic_model(mesh, fabric);
  const auto pull = [&](double e) {
    Points x = flat_positions(mesh), g;
    x.row(0) *= 1 + e;
    model->gradient(x, g);
    model->set_history(model->next_history(x));
    double sum = 0;
    for (int i = 0; i < x.cols(); ++i)
      if (mesh.material(0, i) > 0.1 - 1e-9) sum += g(0, i);
    return sum / 0.05;
  };
  double up = 0, down = 0;
  for (const double e : {0.01, 0.03, 0.05, 0.08}) (e == 0.05 ? up : down) = pull(e);
  for (const double e : {0.06, 0.05}) down = pull(e);
  EXPECT_NEAR(up, 500 * 0.05 + 8 * 1.05, 1e-6);  // friction stress is on the Green strain
  EXPECT_NEAR(down, 500 * 0.05 - 8 * 1.05, 1e-6);
}

/// The stress of a test at `strain` after half of it, and after twice of it.
std::pair<double, double> loading_and_unloading(const Fabric& fabric, MaterialTest test,
                                                double strain) {
  const std::array strains{0.5 * strain, strain, 2 * strain, 1.5 * strain, strain};
  MaterialResponseOptions options;
  options.path = StrainPath::continued;
  options.cell = kSize;
  const VecX stress = material_response(fabric, test, strains, options).stress;
  return {stress[1], stress[4]};
}

TEST(FrictionModel, LoopsOfSpringsAndOfTheTableLieTwoAmplitudesApart) {
  // Elongation is the strain of springs, that of Green of the table: its stress is by 1.02 more
  // force. A shear of 0.02 turns the diagonals by 0.01: its square is what is left out.
  const auto apart = [](const Fabric& fabric, MaterialTest test) {
    const auto [loading, unloading] = loading_and_unloading(fabric, test, 0.02);
    return loading - unloading;
  };
  for (const std::string name : {"springs", "piecewise-linear"}) {
    SCOPED_TRACE(name);
    Fabric fabric = Fabric::with_defaults("rough", name);
    for (const auto& [component, amplitude] :
         {std::pair<std::string, double>{"weft_stretch", 8}, {"shear", 3}}) {
      fabric.include(component + "_friction");
      fabric.include(component + "_friction_scale");
      fabric.set(component + "_friction", amplitude);
      fabric.set(component + "_friction_scale", 1e-4);
    }
    Fabric stretch = fabric, shear = fabric;
    for (const char* word : {"", "_scale"}) {
      stretch.leave_out(std::string("shear_friction") + word);
      shear.leave_out(std::string("weft_stretch_friction") + word);
    }
    const double force = name == "springs" ? 1 : 1.02;
    EXPECT_NEAR(apart(stretch, MaterialTest::weft_stretch), 2 * 8 * force, 1e-6);
    EXPECT_NEAR(apart(shear, MaterialTest::shear), 2 * 3, 2 * 3 * 4e-4);
  }
}

TEST(FrictionModel, OfTheTableDoesNotChangeItsElasticPart) {
  // At a history the difference to the table alone is that of the same friction beside "stvk".
  const TriangleMesh mesh = make_swatch(3 * kSize, 2 * kSize, 4, 3);
  const auto part_of_friction = [&](const std::string& name, const Points& x) {
    Fabric smooth = rough(name);
    for (const char* component : {"warp_stretch", "shear", "weft_bend"})
      for (const char* word : {"_friction", "_friction_scale"})
        smooth.leave_out(std::string(component) + word);
    const auto with = make_elastic_model(mesh, rough(name)),
               without = make_elastic_model(mesh, smooth);
    start_from_a_frame(*with);
    Points g, elastic;
    with->gradient(x, g);
    without->gradient(x, elastic);
    return Points(g - elastic);
  };
  for (const Points& x : testing::states(mesh, kSize)) {
    const Points of_table = part_of_friction("piecewise-linear", x);
    const double size = of_table.cwiseAbs().maxCoeff();
    EXPECT_GT(size, 1e-3);
    // The elastic forces, which cancel, are up to 1e3 N here.
    EXPECT_LT((of_table - part_of_friction("stvk", x)).cwiseAbs().maxCoeff(), 1e-9 * size + 1e-11);
  }
}

TEST(FrictionModel, WithoutFrictionThereIsNoHistory) {
  const auto model =
      make_elastic_model(make_swatch(0.1, 0.1, 3, 3), Fabric::with_defaults("a", "stvk"));
  EXPECT_EQ(model->history_size(), 0);
  EXPECT_EQ(model->next_history(flat_positions(model->mesh())).size(), 0);
  EXPECT_THROW(model->set_history(VecX::Zero(12)), Error);
}

}  // namespace
}  // namespace weft::friction_test
