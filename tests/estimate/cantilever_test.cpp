#include "weft/estimate/cantilever.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <numbers>

#include "common/temporary_folder.h"
#include "dynamics/elastica.h"
#include "weft/base/error.h"
#include "weft/capture/table_file.h"
#include "weft/estimate/mechanical_fit.h"
#include "weft/vision/strip_profile.h"

namespace weft::cantilever_test {
namespace {

// G = w c^3: 200 g/m^2 is 1.96133 N/m^2; of a bending length of 2 cm, 1.569e-5 N m.
TEST(Cantilever, RigidityAndBendingLength) {
  const double weight = 0.2 * kStandardGravity;
  EXPECT_NEAR(flexural_rigidity(weight, 0.02), 1.569064e-5, 1e-11);
  EXPECT_NEAR(bending_length(weight, 1.569064e-5), 0.02, 1e-8);
  EXPECT_EQ(standard_bending_length(0.04), 0.02);
  EXPECT_THROW(flexural_rigidity(0, 0.02), Error);
  EXPECT_THROW(rigidity_of_overhang(weight, -1), Error);
}

// An independent solution of the same equation, by tip deflection.
TEST(HeavyElastica, TipDeflectionOfAConstantRigidity) {
  for (const double load : {0.5, 5.0, 50.0}) {
    const ElasticaProfile profile = heavy_elastica(2.0, 2 * load / 0.027, 0.3);
    const Vec2 tip = profile.at.col(profile.at.cols() - 1);
    EXPECT_NEAR(-tip.y() / 0.3, test::elastica_tip_deflection(load), 1e-6) << load;
    EXPECT_NEAR(profile.angle[0], 0, 1e-9);
  }
  // To first order w L^4 / (8 B), and w L^2 / 2 at the root.
  const ElasticaProfile small = heavy_elastica(1.0, 1e-3, 1);
  EXPECT_NEAR(-small.at(1, small.at.cols() - 1), 1e-3 / 8, 1e-9);
  EXPECT_NEAR(small.moment[0], 0.5e-3, 1e-9);
}

// Moment balance: what the bent strip weighs, times its lever arms.
TEST(HeavyElastica, MomentsOfACurveAreThoseOfTheWeight) {
  const BendLaw bend{StiffnessCurve(Vec3(0, 5, 15), Vec3(4e-2, 2.5e-2, 2e-2)), 1e-2, 2};
  const ElasticaProfile profile = heavy_elastica(bend, 10, 0.2, 0.1);
  EXPECT_NEAR(profile.angle[0], 0.1, 1e-9);
  const MomentCurvature balance = moment_curvature(profile.at, 10);
  for (Eigen::Index i = 0; i < profile.arc.size(); i += 40) {
    EXPECT_NEAR(balance.moment[i], profile.moment[i], 2e-5 * profile.moment[0]) << i;
    EXPECT_NEAR(bend.respond(profile.curvature[i]).moment, profile.moment[i], 1e-9) << i;
  }
}

TEST(HeavyElastica, RefusesWhatHasNoSolution) {
  EXPECT_THROW(heavy_elastica(1.0, 0, 1), Error);
  EXPECT_THROW(heavy_elastica(1.0, 1, 1, 1.5), Error);
  // k c falls from c = 1 on.
  EXPECT_THROW(heavy_elastica(BendLaw{StiffnessCurve(Vec2(0, 2), Vec2(1, 0.01))}, 1, 1), Error);
}

TEST(Overhang, IsThatOfTheElastica) {
  const double weight = 1.5, rigidity = 3e-5;
  const double overhang = overhang_of_rigidity(weight, rigidity);
  EXPECT_NEAR(rigidity_of_overhang(weight, overhang), rigidity, 1e-9 * rigidity);
  const ElasticaProfile profile = heavy_elastica(rigidity, weight, overhang);
  const Vec2 tip = profile.at.col(profile.at.cols() - 1);
  EXPECT_NEAR(std::atan2(-tip.y(), tip.x()), 41.5 * kDegree, 1e-6);
  // The half of the standard and Peirce's formula.
  const double exact = bending_length(weight, rigidity);
  EXPECT_NEAR(peirce_bending_length(overhang), 1.019 * exact, 0.001 * exact);
  EXPECT_NEAR(standard_bending_length(overhang), exact, 5e-4 * exact);
}

// A quarter circle of radius r with the clamp on top: x = r sin(s / r). M at s is w r^2 (...).
TEST(MomentCurvatureOfAProfile, CircularArc) {
  constexpr int kPoints = 200;
  const double radius = 0.1, weight = 3;
  MaterialPoints arc(2, kPoints);
  for (int i = 0; i < kPoints; ++i) {
    const double angle = std::numbers::pi / 2 * i / (kPoints - 1);
    arc.col(i) = Vec2(radius * std::sin(angle), radius * (std::cos(angle) - 1));
  }
  const MomentCurvature found = moment_curvature(arc, weight, 0.02);
  EXPECT_NEAR(found.moment[0], weight * radius * radius, 1e-4 * weight * radius * radius);
  EXPECT_EQ(found.moment[kPoints - 1], 0);
  for (int i = 0; i < kPoints; i += 20) EXPECT_NEAR(found.curvature[i], 10, 0.05) << i;
  EXPECT_THROW(moment_curvature(arc.leftCols(5), weight), Error);
  EXPECT_THROW(moment_curvature(arc, weight, 1e-4), Error);
}

/// A strip of 0.1 m, at `count` points.
MaterialPoints bent_strip(Eigen::Index count) {
  const int part = 400 / static_cast<int>(count - 1);
  const ElasticaProfile bent = heavy_elastica(2e-5, 2, 0.1);
  MaterialPoints points(2, count);
  for (Eigen::Index i = 0; i < count; ++i) points.col(i) = bent.at.col(i * part);
  return points;
}

std::string refusal_of(const MaterialPoints& profile) {
  try {
    fit_cantilever(profile, 2);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(FitCantilever, RefusesWhatGravityDoesNotBend) {
  using ::testing::HasSubstr;
  const MaterialPoints strip = bent_strip(41);
  EXPECT_EQ(refusal_of(strip), "no error");
  MaterialPoints up = strip;
  up.row(1) *= -1;
  EXPECT_THAT(refusal_of(up),
              AllOf(HasSubstr("m above the line along which"), HasSubstr("y is up")));
  EXPECT_THAT(refusal_of(strip.rowwise().reverse()), HasSubstr("the first point at the clamp"));
  // From the tip, to the right: a strip that would point up steeply, and bend over.
  MaterialPoints mirrored = strip.rowwise().reverse();
  mirrored.row(0) *= -1;
  EXPECT_THAT(refusal_of(mirrored), HasSubstr("no strip under gravity bends like the profile"));
  EXPECT_THAT(refusal_of(1000 * strip), HasSubstr("m, must be at most 10; x and y are in m"));
  // Noise on a strip that hardly bends is none of these.
  MaterialPoints straight(2, 20);
  for (Eigen::Index i = 0; i < 20; ++i)
    straight.col(i) = Vec2(0.005 * static_cast<double>(i), i % 2 == 0 ? 1e-4 : -1e-4);
  EXPECT_NO_THROW(moment_curvature(straight, 2));
}

// A third of the length would hold 7 of 21 points at the ends.
TEST(MomentCurvatureOfAProfile, WindowHoldsWhatACubicNeeds) {
  for (const Eigen::Index count : {9, 21}) {
    const MaterialPoints strip = bent_strip(count);
    const MomentCurvature curve = moment_curvature(strip, 2);
    EXPECT_EQ(curve.moment, profile_moment(strip, 2));
    EXPECT_EQ(curve.arc, profile_arc(strip));
    for (const double c : curve.curvature) EXPECT_TRUE(std::isfinite(c)) << count;
  }
}

TEST(FitCantilever, RecoversTheLawThatBentAStrip) {
  const double weight = 4, length = 0.15;
  const ElasticaProfile linear = heavy_elastica(2e-3, weight, length, 0.05);
  const CantileverFit constant = fit_cantilever(linear.at, weight);
  EXPECT_NEAR(constant.law.bend.stiffness(0), 2e-3, 2e-6);
  EXPECT_NEAR(constant.root_angle, 0.05, 1e-3);
  EXPECT_LT(constant.distance_rms, 1e-5);

  const BendLaw law{StiffnessCurve(1e-3), 2e-2, 2};
  const ElasticaProfile bent = heavy_elastica(law, weight, length, 0.05);
  const CantileverFit found = fit_cantilever(bent.at, weight, BendTerms::friction);
  EXPECT_LT(found.distance_rms, 1e-6);
  for (const double part : {0.2, 0.6, 1.0}) {
    const double c = part * bent.curvature[0], moment = law.respond(c).moment;
    EXPECT_NEAR(found.law.respond(c).moment, moment, 0.01 * moment);
  }
  EXPECT_GT(fit_cantilever(bent.at, weight).distance_rms, 2e-4);
}

// The ten-line capture of a profile, fitted on a mesh like any mechanical capture.
TEST(CantileverCapture, FitRecoversTheRigidityOnAMesh) {
  const double density = 0.2, rigidity = 2e-5;
  const ElasticaProfile bent = heavy_elastica(rigidity, density * 9.81, 0.1, 0.1);
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "capture.toml")
      << "format = \"weft-capture\"\nversion = 1\nkind = \"mechanical\"\ntest = \"cantilever\"\n"
         "specimen = { width = 0.02, areal_density = 0.2 }\n"
         "[profile]\nfile = \"profile.csv\"\nclamp_angle_deg = "
      << 0.1 * 180 / std::numbers::pi << "\n";
  std::ofstream profile(folder.path() / "profile.csv");
  profile << std::setprecision(12) << "x,y\n";
  for (Eigen::Index i = 0; i < bent.at.cols(); i += 20)
    profile << bent.at(0, i) << ',' << bent.at(1, i) << '\n';
  profile.close();
  MechanicalOptions options;
  options.cells = 8;
  const auto trial = prepare_mechanical(read_mechanical_capture(folder.path()), options);
  Fabric fabric = Fabric::with_defaults("strip", "stvk-diagonal");
  fabric.set("weft_stretch", 5000);
  fabric.set("weft_bend", 3 * rigidity);
  const MechanicalFitResult fit =
      fit_mechanical(MechanicalProblem({trial}, fabric, {"weft_bend"}), fabric);
  EXPECT_NEAR(fit.fabric.value("weft_bend"), rigidity,
              0.015 * rigidity);  // 2.1, 1.0 % with 4, 8 cells
}

// A real glass fabric of 13.6 N/m^2; the published moment at the clamp is 0.3879 N.
TEST(PhotographedCantilever, RootMomentIsThePublishedOne) {
  const std::filesystem::path data =
      std::filesystem::path(WEFT_SOURCE_DIR) / "data/textiles/cantilever";
  const double published = TableFile(data / "published.csv").numbers("moment")[0];
  const TableFile table(data / "profile.csv");
  MaterialPoints profile(2, static_cast<Eigen::Index>(table.row_count()));
  profile.row(0) = table.numbers("x").transpose();
  profile.row(1) = table.numbers("y").transpose();
  EXPECT_NEAR(moment_curvature(profile, 13.6).moment[0], published, 0.002 * published);

  MaterialPoints photographed =
      find_strip_profile(read_grey_image(data / "photograph.jpg")) * 0.1101e-3;
  photographed.row(1) *= -1;
  EXPECT_NEAR(moment_curvature(photographed, 13.6).moment[0], published, 0.02 * published);

  // Both see the same law: a rigidity and friction that is overcome within a few 1/m.
  const CantileverFit a = fit_cantilever(profile, 13.6, BendTerms::friction);
  const CantileverFit b = fit_cantilever(photographed, 13.6, BendTerms::friction);
  EXPECT_LT(a.distance_rms, 5e-4);
  EXPECT_LT(b.distance_rms, 5e-4);
  for (const double c : {2.0, 5.0, 8.0})
    EXPECT_NEAR(a.law.respond(c).moment, b.law.respond(c).moment, 0.05 * a.law.respond(c).moment);
}

}  // namespace
}  // namespace weft::cantilever_test
