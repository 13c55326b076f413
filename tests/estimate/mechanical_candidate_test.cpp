/// What a mechanical test would tell, against closed forms.
#include "weft/estimate/mechanical_candidate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/capture/mechanical_writer.h"
#include "weft/estimate/cantilever.h"
#include "weft/estimate/suggest.h"

namespace weft::mechanical_candidate_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Kind = CandidateTest::Kind;

constexpr double kLength = 0.2, kWidth = 0.05, kStiffness = 800;  // m, m, N/m

/// Threads that do not know of each other.
Fabric fabric() {
  Fabric fabric = Fabric::with_defaults("known", "stvk");
  fabric.set("membrane_uu", kStiffness);
  fabric.set("membrane_vv", 300);
  fabric.set("membrane_uv", 1e-4);
  fabric.set("bend_uv", 1e-12);
  return fabric;
}

MechanicalInformationOptions few_cells() {
  MechanicalInformationOptions options;
  options.mechanical.cells = 4;
  return options;
}

CandidateTest strip() {
  CandidateTest test;
  test.specimen = {kLength, kWidth};
  test.first = 0.002;
  test.last = 0.01;
  test.readings = 5;
  test.force_noise = 0.01;
  return test;
}

/// d value / d scaled coordinate, of a logarithmic scale.
double slope(const ParameterInfo& info, double value) {
  return value * std::log(info.upper / info.lower);
}

double information_of(const MatX& information, const std::string& name) {
  const int i = fabric().value_index(name);
  return information(i, i);
}

TEST(MechanicalInformation, AStripTellsTheStretchAlongItsPull) {
  const MatX along = mechanical_information(strip(), fabric(), few_cells());
  double squares = 0;  // of dF / dA, m^2: a linear law between Green strain and stress
  for (int k = 1; k <= 5; ++k) {
    const double s = 0.002 * k / kLength;
    squares += std::pow(kWidth * (s + s * s / 2) * (1 + s), 2);
  }
  const double sigma = strip().force_noise / std::sqrt(squares);  // N/m
  const ParameterInfo info = fabric().info(fabric().value_index("membrane_uu"));
  const double expected = std::pow(slope(info, kStiffness) / sigma, 2);
  EXPECT_NEAR(information_of(along, "membrane_uu"), expected, 1e-4 * expected);
  EXPECT_LT(information_of(along, "membrane_vv"), 1e-6 * expected);
  EXPECT_LT(information_of(along, "bend_uu"), 1e-6 * expected);

  CandidateTest across = strip();
  across.specimen.grain_angle = std::numbers::pi / 2;
  const MatX other = mechanical_information(across, fabric(), few_cells());
  EXPECT_LT(information_of(other, "membrane_uu"), 1e-6 * information_of(other, "membrane_vv"));
}

TEST(MechanicalInformation, NoiseOfTheClipsCounts) {
  CandidateTest test = strip();
  test.last = test.first = 1e-4;
  test.readings = 1;
  const double exact =
      information_of(mechanical_information(test, fabric(), few_cells()), "membrane_uu");
  test.clip_noise = 5e-5;
  const double noisy =
      information_of(mechanical_information(test, fabric(), few_cells()), "membrane_uu");
  // Both ends are off along the pull, on a spring.
  const double from_poses = kStiffness * kWidth / kLength * test.clip_noise;
  const double share = 1 / (1 + 2 * std::pow(from_poses / test.force_noise, 2));
  EXPECT_NEAR(noisy / exact, share, 0.01 * share);
}

TEST(MechanicalInformation, ACantileverTellsTheBendAlongIt) {
  CandidateTest test;
  test.kind = Kind::cantilever;
  test.specimen = {0.05, 0.02, 0.15};
  test.readings = 11;
  Fabric stiff = fabric();
  stiff.set("bend_uu", 1e-3);
  const MatX found = mechanical_information(test, stiff, few_cells());
  // Of a small deflection, q x^2 (6 L^2 - 4 L x + x^2) / (24 D), at both sides of the strip.
  const double length = test.specimen.free_length;
  double squares = 0;
  for (int k = 0; k <= 10; ++k) {
    const double x = 0.1 * k * length;
    const double sag = 9.81 * 0.15 * x * x * (6 * length * length - 4 * length * x + x * x) /
                       (24 * stiff.value("bend_uu"));
    squares += 2 * sag * sag;
  }
  const ParameterInfo info = stiff.info(stiff.value_index("bend_uu"));
  const double expected =
      std::pow(std::log(info.upper / info.lower) / test.point_noise, 2) * squares;
  EXPECT_NEAR(information_of(found, "bend_uu"), expected, 0.03 * expected);
  for (const char* name : {"membrane_uu", "membrane_vv", "bend_vv"})
    EXPECT_LT(information_of(found, name), 1e-3 * expected) << name;
}

// dL / L = dB / (3 B) of a strip without Poisson effect; n readings tell n times as much.
TEST(MechanicalInformation, AnOverhangTellsTheBendAlongIt) {
  CandidateTest test;
  test.kind = Kind::overhang;
  test.specimen = {0, 0.02, 0.15};
  test.readings = 4;
  test.deviation = 5e-4;
  Fabric known = fabric();
  known.set("bend_uu", 2e-5);
  known.set("bend_uv", 1e-12);
  const MatX found = mechanical_information(test, known, few_cells());
  const double overhang = overhang_of_rigidity(9.81 * 0.15, 2e-5);
  const ParameterInfo info = known.info(known.value_index("bend_uu"));
  const double slope = std::log(info.upper / info.lower) * overhang / 3;
  const double expected = test.readings * std::pow(slope / test.deviation, 2);
  EXPECT_NEAR(information_of(found, "bend_uu"), expected, 0.05 * expected);
  EXPECT_LT(information_of(found, "bend_vv"), 1e-3 * expected);
}

TEST(MechanicalInformation, IsOfModelsOfMotionsToo) {
  const Fabric known = Fabric::with_defaults("known");
  const MatX found = mechanical_information(strip(), known, few_cells());
  const int stretch = known.value_index("stretch_stiffness");
  EXPECT_GT(found(stretch, stretch), 1);
  for (const char* name : {"stretch_damping", "drag_linear"})
    EXPECT_EQ(found.row(known.value_index(name)).norm(), 0) << name;
}

TEST(MechanicalInformation, RefusesValuesOutOfRange) {
  const auto message = [](const CandidateTest& test) -> std::string {
    try {
      mechanical_information(test, fabric(), few_cells());
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  CandidateTest test = strip();
  test.name = "far";
  test.last = 0.5;
  EXPECT_THAT(message(test), AllOf(HasSubstr("\"far\""), HasSubstr("displacement = 0.5")));
  test = strip();
  test.specimen.width = NAN;
  EXPECT_THAT(message(test), HasSubstr("width = nan, valid: 0.001 to 10"));
  test = strip();
  test.kind = Kind::cantilever;
  test.readings = 7;
  EXPECT_THAT(message(test), HasSubstr("readings = 7, valid: 8"));
  test = strip();
  test.force_noise = 0;
  EXPECT_THAT(message(test), HasSubstr("force_noise = 0"));
}

class CandidateFile : public ::testing::Test {
 protected:
  std::vector<Candidate> read(const std::string& text) const {
    write("experiments.toml",
          "format = \"weft-experiments\"\nversion = 1\n[[experiment]]\n" + text);
    return read_candidates(folder_.path() / "experiments.toml");
  }
  std::string message(const std::string& text) const {
    try {
      read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  void write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_.path() / name).parent_path());
    std::ofstream(folder_.path() / name) << text;
  }

  const std::string strip_ =
      "test = \"strip\"\nspecimen = { free_length = 0.2, width = 0.05, grain_angle_deg = 90 }\n"
      "curve = { displacement = [1, 12], displacement_unit = \"mm\", readings = 7 }\n";
  test::TemporaryFolder folder_;
};

TEST_F(CandidateFile, HasTestsInTheFormOfCaptures) {
  const auto strip = std::get<CandidateTest>(
      read(strip_ + "force_noise = 0.02\nclip_noise = 1e-5\nname = \"pull\"\n").front());
  EXPECT_EQ(strip.name, "pull");
  EXPECT_EQ(strip.kind, Kind::strip);
  EXPECT_NEAR(strip.specimen.grain_angle, std::numbers::pi / 2, 1e-15);
  EXPECT_EQ(strip.specimen.areal_density, 0);
  EXPECT_NEAR(strip.first, 0.001, 1e-15);
  EXPECT_NEAR(strip.last, 0.012, 1e-15);
  EXPECT_EQ(strip.readings, 7);
  EXPECT_EQ(strip.force_noise, 0.02);
  EXPECT_EQ(strip.clip_noise, 1e-5);

  const auto bias = std::get<CandidateTest>(
      read("test = \"bias-extension\"\nspecimen = { free_length = 0.2, width = 0.1 }\n"
           "curve = { displacement = [0, 0.02], readings = 3 }\n")
          .front());
  EXPECT_NEAR(bias.specimen.grain_angle, std::numbers::pi / 4, 1e-15);
  EXPECT_EQ(bias.last, 0.02);
  EXPECT_THAT(bias.name, HasSubstr("bias-extension 200 x 100 mm at 45 degrees"));

  const auto flap = std::get<CandidateTest>(
      read("test = \"cantilever\"\nspecimen = { free_length = 0.05, width = 0.02, "
           "areal_density = 0.2 }\nprofile = { readings = 12, clamp_angle_deg = 30 }\n"
           "point_noise = 1e-4\n")
          .front());
  EXPECT_EQ(flap.readings, 12);
  EXPECT_NEAR(flap.clamp_angle, std::numbers::pi / 6, 1e-15);
  EXPECT_EQ(flap.specimen.areal_density, 0.2);
  EXPECT_EQ(flap.point_noise, 1e-4);
}

TEST_F(CandidateFile, AnOverhangNeedsNoLength) {
  const auto test = std::get<CandidateTest>(
      read("test = \"overhang\"\nspecimen = { width = 0.025, grain_angle_deg = 90 }\n"
           "overhang = { readings = 8, angle_deg = 43, deviation = 2e-3 }\n")
          .front());
  EXPECT_EQ(test.kind, Kind::overhang);
  EXPECT_EQ(test.readings, 8);
  EXPECT_NEAR(test.angle, 43 * std::numbers::pi / 180, 1e-15);
  EXPECT_EQ(test.deviation, 2e-3);
  EXPECT_EQ(test.name, "overhang 25 mm wide at 90 degrees, 8 readings");
}

TEST_F(CandidateFile, IsReadStrictly) {
  EXPECT_THAT(message("test = \"overhang\"\nspecimen = { free_length = 0.2, width = 0.05 }\n"
                      "overhang = { readings = 2 }\n"),
              HasSubstr("free_length"));
  EXPECT_THAT(message("test = \"overhang\"\nspecimen = { width = 0.05 }\n"
                      "overhang = { readings = 2, deviation = 1 }\n"),
              HasSubstr("deviation"));
  EXPECT_THAT(message("test = \"grab\"\n"),
              AllOf(HasSubstr("experiments.toml:4"), HasSubstr("\"grab\" is not valid")));
  EXPECT_THAT(message("test = \"strip\"\n"), HasSubstr("specimen"));
  EXPECT_THAT(message(strip_ + "point_noise = 1e-4\n"), HasSubstr("point_noise"));
  EXPECT_THAT(message(strip_ + "separation = 0.5\n"), HasSubstr("separation"));
  EXPECT_THAT(message(strip_ + "capture = \"folder\"\n"), HasSubstr("capture"));
  EXPECT_THAT(message(strip_ + "force_noise = 0\n"),
              AllOf(HasSubstr("experiments.toml:7"), HasSubstr("force_noise")));
  EXPECT_THAT(message("test = \"strip\"\nspecimen = { free_length = 0.2, width = 0.05 }\n"
                      "curve = { displacement = [0, 12], readings = 7 }\n"),
              AllOf(HasSubstr("displacement"), HasSubstr("0.4")));
  EXPECT_THAT(message("test = \"cantilever\"\nspecimen = { free_length = 0.2, width = 0.05 }\n"
                      "profile = { readings = 2 }\n"),
              HasSubstr("readings"));
  EXPECT_THAT(message("capture = \"nowhere\"\n"),
              AllOf(HasSubstr("experiments.toml:4"), HasSubstr("nowhere\" is no folder")));
}

TEST_F(CandidateFile, ACaptureIsItsTestWhateverWasMeasured) {
  const auto information = [&](double force) {
    write("strip/capture.toml",
          "format = \"weft-capture\"\nversion = 1\nkind = \"mechanical\"\ntest = \"strip\"\n"
          "specimen = { free_length = 0.2, width = 0.05, areal_density = 0.15 }\n"
          "[curve]\nfile = \"c.csv\"\ndisplacement = \"x\"\nforce = \"F\"\n");
    std::string curve = "x,F\n";
    for (int k = 1; k <= 5; ++k)
      curve += std::to_string(0.002 * k) + "," + std::to_string(force) + "\n";
    write("strip/c.csv", curve);
    const Candidate candidate = read("capture = \"strip\"\nforce_noise = 0.01\n").front();
    return mechanical_information(std::get<CandidateCapture>(candidate), fabric(), few_cells());
  };
  const MatX found = information(1);
  EXPECT_EQ((found - information(77)).norm(), 0);
  const MatX planned = mechanical_information(strip(), fabric(), few_cells());
  EXPECT_LT((found - planned).norm(), 1e-9 * planned.norm());
}

TEST_F(CandidateFile, FrictionOfCordsIsOneMoreUnknown) {
  const VecX moves = VecX::LinSpaced(5, 0.002, 0.01);
  MechanicalCapture capture =
      strip_capture({kLength, kWidth, 0.15}, moves, VecX::Ones(moves.size()));
  capture.fixtures.back().forces.setOnes();  // all components
  const auto stretch = [&](ClipDrive drive) {
    capture.drive = drive;
    write_mechanical_capture(folder_.path() / "pull", capture);
    const CandidateCapture candidate{"pull", folder_.path() / "pull"};
    return information_of(mechanical_information(candidate, fabric(), few_cells()), "membrane_uu");
  };
  // Where the jaw only ever moves on, friction is an offset of all readings but the first, into
  // which it has no way.
  const VecX strain = moves / kLength;
  const VecX slopes = (strain.array() * (1 + strain.array() / 2) * (1 + strain.array())).matrix();
  const double offset = slopes.tail(4).sum() / 2;
  const double share = 1 - offset * offset / slopes.squaredNorm();
  EXPECT_NEAR(stretch(ClipDrive::cords) / stretch(ClipDrive::rigid), share, 1e-3 * share);
}

}  // namespace
}  // namespace weft::mechanical_candidate_test
