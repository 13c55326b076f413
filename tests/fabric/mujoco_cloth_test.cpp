#include "weft/fabric/mujoco_cloth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <regex>
#include <sstream>

#include "weft/base/error.h"

namespace weft::mujoco_cloth_test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

Fabric plain() {
  Fabric fabric = Fabric::with_defaults("plain");
  fabric.set("stretch_stiffness", 100);
  fabric.set("shear_stiffness", 40);
  fabric.set("stretch_damping", 0.1);
  fabric.set("shear_damping", 0.02);
  fabric.set("bend_stiffness", 1e-5);
  fabric.set("bend_damping", 2e-7);
  fabric.set("drag_linear", 0.3);
  fabric.set("drag_quadratic", 0);
  return fabric;
}

MujocoClothOptions cells(int columns, int rows) {
  MujocoClothOptions options;
  options.spacing = 0.02;
  options.columns = columns;
  options.rows = rows;
  options.areal_density = 0.25;
  return options;
}

TEST(MujocoCloth, AStripIsAsStiffAsTheFabric) {
  const MujocoCloth cloth = mujoco_cloth(plain(), cells(4, 4));
  EXPECT_EQ(cloth.shear_stiffness, 40);
  // Of a lattice C11 = a + k, C12 = k, so that a free strip has C11 - C12^2 / C11.
  const double c11 = cloth.thread_stiffness + cloth.shear_stiffness;
  EXPECT_NEAR(c11 - 40 * 40 / c11, 100, 1e-12);
  const double damping = cloth.thread_damping + cloth.shear_damping;
  EXPECT_NEAR(damping - 0.02 * 0.02 / damping, 0.1, 1e-15);
  EXPECT_THAT(cloth.lost, Contains(HasSubstr("narrows along the other by 0.35 of the strain")));
}

TEST(MujocoCloth, BendsAsTheFabricOnTheMean) {
  Fabric fabric = plain();
  fabric.include("twist_stiffness");
  fabric.set("twist_stiffness", 3e-5);
  const MujocoCloth cloth = mujoco_cloth(fabric, cells(4, 4));
  EXPECT_NEAR(cloth.bend_stiffness, std::sqrt(1e-5 * 2e-5), 1e-19);
  EXPECT_NEAR(cloth.bend_damping, 0.02, 1e-15);
  // sqrt(2e-10) / sqrt(10) times 2.5 and 4
  EXPECT_THAT(cloth.lost, Contains(HasSubstr("Bend is 1.12e-05 N m along the threads and 1.79e-05 "
                                             "at 45 degrees; the fabric has 1e-05 and 2e-05")));
}

TEST(MujocoCloth, ShorterStepsForStifferDampedAndFinerCloth) {
  const auto step = [](const Fabric& fabric, double spacing) {
    MujocoClothOptions options = cells(4, 4);
    options.spacing = spacing;
    return mujoco_cloth(fabric, options).timestep;
  };
  Fabric bare = plain();
  for (const char* damping : {"stretch_damping", "shear_damping"}) bare.set(damping, 1e-3);
  bare.set("bend_stiffness", 1e-7);
  bare.set("bend_damping", 1e-9);
  // rho h^2 = 1e-4 kg, a + k = 114.03 N/m, their damping 1.618e-3 N s/m: w^2 = 4.561e6 1/s^2,
  // c = 67 1/s (2.3 of it bend's), half of (sqrt(c^2 + 4 w^2) - c) / w^2 = 4.61e-4 s
  EXPECT_NEAR(step(bare, 0.02), 4.6e-4, 1e-12);
  EXPECT_LT(step(plain(), 0.02), 4.6e-4);
  EXPECT_NEAR(step(bare, 0.01), 2.2e-4, 1e-12);
  Fabric stiff = bare;
  stiff.set("bend_stiffness", 1e-2);
  // 288 D / h^2 adds 2.28e7 1/s^2 to w^2.
  EXPECT_NEAR(step(stiff, 0.02), 1.9e-4, 1e-12);
}

/// What the text says of a body: mass, and whether it is of mocap.
struct Body {
  std::vector<double> at;
  double mass = 0;
  bool mocap = false;
};

std::vector<double> numbers(const std::string& text) {
  std::istringstream in(text);
  return {std::istream_iterator<double>(in), {}};
}

std::map<std::string, Body> bodies_of(const std::string& model) {
  std::map<std::string, Body> bodies;
  const std::regex body(R"re(<body name="([^"]*)" pos="([^"]*)"(.*)</body>)re");
  const std::regex mass(R"re(mass="([^"]*)")re");
  for (auto at = std::sregex_iterator(model.begin(), model.end(), body);
       at != std::sregex_iterator(); ++at) {
    const std::string rest = (*at)[3];
    std::smatch found;
    Body read{numbers((*at)[2])};
    if (std::regex_search(rest, found, mass)) read.mass = std::stod(found[1]);
    read.mocap = rest.find("mocap=\"true\"") != std::string::npos;
    bodies[(*at)[1]] = read;
  }
  return bodies;
}

/// Elements of a flex, by the names of their bodies.
struct Flex {
  std::vector<std::string> bodies;
  std::vector<int> elements;
  std::string inside;
};

Flex flex_of(const std::string& model, const std::string& name) {
  const std::regex flex(
      "<flex name=\"" + name +
      R"re(" dim="\d" radius="[^"]*" body="([^"]*)" element="([^"]*)"(.*)</flex>)re");
  std::smatch found;
  if (!std::regex_search(model, found, flex)) return {};
  std::istringstream names(found[1]);
  Flex read{{std::istream_iterator<std::string>(names), {}}, {}, found[3]};
  for (const double v : numbers(found[2])) read.elements.push_back(static_cast<int>(v));
  return read;
}

std::string model_of(const Fabric& fabric, const MujocoClothOptions& options) {
  return mujoco_model(fabric, mujoco_cloth(fabric, options), options);
}

TEST(MujocoCloth, BodiesWeighWhatTheSwatchDoes) {
  MujocoClothOptions options = cells(5, 3);
  options.hem_width = 0.004;
  const auto bodies = bodies_of(model_of(plain(), options));
  ASSERT_EQ(bodies.size(), 6 * 4);
  double mass = 0;
  for (const auto& [name, body] : bodies) mass += body.mass;
  const double width = 0.1, height = 0.06;
  EXPECT_NEAR(mass, 0.25 * (width * height + 0.004 * 2 * (width + height)), 1e-10);
  EXPECT_THAT(bodies.at("cloth_5_2").at, ElementsAre(0.1, 0, -0.04));
}

TEST(MujocoCloth, HoldsWhatItIsAskedTo) {
  const auto held = [](MujocoHold hold) {
    MujocoClothOptions options = cells(3, 2);
    options.held = hold;
    std::vector<std::string> names;
    for (const auto& [name, body] : bodies_of(model_of(plain(), options))) {
      if (body.mocap) names.push_back(name);
      EXPECT_EQ(body.mass == 0, body.mocap) << name;
    }
    return names;
  };
  EXPECT_THAT(held(MujocoHold::none), IsEmpty());
  EXPECT_THAT(held(MujocoHold::corners), ElementsAre("cloth_0_0", "cloth_3_0"));
  EXPECT_THAT(held(MujocoHold::edge),
              ElementsAre("cloth_0_0", "cloth_1_0", "cloth_2_0", "cloth_3_0"));
}

/// The first triangle of a thread has its ends in the order of their places, where MuJoCo takes
/// them from (mujoco_cloth.cpp); all triangles face one way, and cover the swatch.
TEST(MujocoCloth, TrianglesAreWhatMujocoCompilesRightly) {
  const std::string model = model_of(plain(), cells(5, 4));
  const auto bodies = bodies_of(model);
  const Flex flex = flex_of(model, "cloth");
  ASSERT_EQ(flex.elements.size(), 3 * 2 * 5 * 4);
  EXPECT_THAT(flex.inside, HasSubstr("elastic2d=\"bend\""));
  const auto at = [&](int v) { return bodies.at(flex.bodies[static_cast<std::size_t>(v)]).at; };
  std::map<std::pair<int, int>, bool> in_order;  // by edge, of its first triangle
  double area = 0;
  for (std::size_t t = 0; t < flex.elements.size(); t += 3) {
    const int* v = &flex.elements[t];
    const auto a = at(v[0]), b = at(v[1]), c = at(v[2]);
    const double twice = (b[0] - a[0]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[0] - a[0]);
    EXPECT_NEAR(twice, 0.02 * 0.02, 1e-12);
    area += twice / 2;
    for (const auto& [from, to] : {std::pair{v[1], v[2]}, {v[2], v[0]}, {v[0], v[1]}})
      in_order.emplace(std::minmax(from, to), from < to);
  }
  EXPECT_NEAR(area, 0.1 * 0.08, 1e-12);
  for (const auto& [edge, right] : in_order) {
    const auto a = at(edge.first), b = at(edge.second);
    const bool diagonal = a[0] != b[0] && a[2] != b[2];
    const bool rim = std::max(a[0], b[0]) == 0 || std::min(a[0], b[0]) == 0.1 ||
                     std::min(a[2], b[2]) == 0 || std::max(a[2], b[2]) == -0.08;
    if (!diagonal && !rim) {
      EXPECT_TRUE(right) << edge.first << " " << edge.second;
    }
  }
}

TEST(MujocoCloth, RimThreadsAreHalfAndTheHem) {
  MujocoClothOptions options = cells(4, 4);
  options.hem_width = 0.005;
  const std::string model = model_of(plain(), options);
  const MujocoCloth cloth = mujoco_cloth(plain(), options);
  const Flex rim = flex_of(model, "rim"), threads = flex_of(model, "threads");
  EXPECT_EQ(rim.elements.size(), 2 * 16);
  EXPECT_EQ(threads.elements.size(), 2 * 2 * 3 * 4);
  std::smatch found;
  ASSERT_TRUE(std::regex_search(rim.inside, found, std::regex(R"re(<edge stiffness="([^"]*)")re")));
  EXPECT_NEAR(std::stod(found[1]), 0.75 * cloth.thread_stiffness, 1e-6);
}

TEST(MujocoCloth, TautDiagonalsAreTendons) {
  EXPECT_THAT(model_of(plain(), cells(2, 2)), Not(HasSubstr("<tendon>")));
  Fabric fabric = Fabric::with_defaults("lattice", "baraff-witkin-hinges");
  fabric.set("diagonal_stiffness", 300);
  fabric.set("diagonal_damping", 0.2);
  const std::string model = model_of(fabric, cells(2, 2));
  const std::regex tendon(
      R"re(<spatial group="5" stiffness="150" damping="0.1" springlength="0 0.0282842712">)re");
  EXPECT_EQ(std::distance(std::sregex_iterator(model.begin(), model.end(), tendon), {}), 8);
  EXPECT_THAT(mujoco_cloth(fabric, cells(2, 2)).lost, Contains(HasSubstr("slack diagonals")));
}

TEST(MujocoCloth, RefusesOtherModelsAndMeshesWithoutSize) {
  EXPECT_THROW(mujoco_cloth(Fabric::with_defaults("sheet", "stvk"), cells(4, 4)), Error);
  EXPECT_THROW(mujoco_cloth(plain(), cells(1, 4)), Error);
  MujocoClothOptions options = cells(4, 4);
  options.spacing = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(mujoco_cloth(plain(), options), Error);
  options = cells(4, 4);
  options.hem_width = -0.001;
  EXPECT_THROW(mujoco_cloth(plain(), options), Error);
}

TEST(MujocoCloth, ANameCannotLeaveItsAttribute) {
  Fabric fabric = plain();
  fabric.name = R"(a "b" <c> & --> d)";
  const std::string model = model_of(fabric, cells(2, 2));
  EXPECT_THAT(model, HasSubstr(R"(<mujoco model="a &quot;b&quot; &lt;c&gt; &amp; --&gt; d">)"));
}

}  // namespace
}  // namespace weft::mujoco_cloth_test
