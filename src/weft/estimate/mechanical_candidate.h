#pragma once
/// Mechanical tests that could be made, and what they would tell of a fabric.
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "weft/base/toml_reader.h"
#include "weft/capture/standard_test.h"
#include "weft/estimate/mechanical_problem.h"

namespace weft {

/// A standard test on a specimen of its own.
struct CandidateTest {
  enum class Kind {
    strip,           ///< pulled lengthwise; its force is read
    bias_extension,  ///< the same, at 45 degrees where a file does not say
    cantilever,      ///< bends under its own weight; its profile is read
    overhang         ///< the same, pushed over an edge; how far it overhangs at an angle is read
  };
  std::string name;  ///< empty: made of the values
  Kind kind = Kind::strip;
  /// Sides 0.001 to 10 m, areal density 0.001 to 10 kg/m^2 or 0: that of the fabric. The free
  /// length of an overhang is that of the fabric, too.
  Specimen specimen{0.2, 0.05};
  /// m, of the moving jaw at the first and the last reading; 0 to twice the free length.
  double first = 0, last = 0.01;
  double clamp_angle = 0;  ///< rad below the horizontal, of a cantilever; up to 80 degrees
  /// Of the force, in equal steps of the jaw, 1 to 10 000; of a cantilever points of the profile in
  /// equal steps of its arc, from 8 on; of an overhang up to 1000, all of one strip.
  int readings = 20;
  double angle =
      OverhangTest().angle;  ///< rad below the horizontal, of an overhang; 1 to 74 degrees
  /// m, standard deviation of a reading of an overhang; 1e-6 to 0.1.
  double deviation = OverhangTest().deviation;
  double force_noise = MechanicalCostOptions().force_noise;  ///< N, 1e-9 to 1000
  double point_noise = MechanicalCostOptions().point_noise;  ///< m, of a coordinate, 1e-9 to 1
  double clip_noise = 0;                                     ///< m, 0 to 0.01, as of a capture
};
/// "strip", "bias-extension", "cantilever", "overhang".
std::string_view name_of(CandidateTest::Kind kind);

/// The test of a mechanical capture, once more: its clips, frame by frame, and the components and
/// points that were measured there. The values that were measured are not used, but for a shape,
/// from which its frame starts.
struct CandidateCapture {
  std::string name;  ///< empty: made of the folder's
  std::filesystem::path folder;
  double force_noise = MechanicalCostOptions().force_noise;  ///< N, 1e-9 to 1000
  double point_noise = MechanicalCostOptions().point_noise;  ///< m, of a coordinate, 1e-9 to 1
};

/// A name made of the values.
std::string words_of(const CandidateTest& test);
std::string words_of(const CandidateCapture& capture);

/// Throws Error with the experiment's name, key, value and valid range.
void check_experiment_value(const std::string& experiment, std::string_view key, double value,
                            Range valid);
/// Throws Error for values out of range; of a capture, unless it can be read.
void check(const CandidateTest& test);
void check(const CandidateCapture& capture);

/// An [[experiment]] with the key `test`, or `capture`, whose path counts from the file's folder
/// (docs/formats.md). Throws Error with file, line and key.
CandidateTest read_candidate_test(const TomlTable& table);
CandidateCapture read_candidate_capture(const TomlTable& table);

/// What tells the stiffnesses of a sheet: strips along the weft, along the warp and at 45 degrees,
/// of 200 x 50 mm, to 5 %; a bias extension of 200 x 100 mm to 10 %; cantilevers of 50 x 25 mm
/// along the weft and along the warp.
std::vector<CandidateTest> default_tests();

struct MechanicalInformationOptions {
  MechanicalOptions mechanical;
  double areal_density = 0.15;  ///< kg/m^2, of a specimen and a fabric that state none
  int threads = 0;              ///< 0: all cores; the result does not depend on it
};

/// Fisher information that the test has about the values of `fabric`, scaled coordinates:
///
///     I = J^T W^T W J,
///
/// J the derivatives of what a fit compares (mechanical_fit.h) over its noise, at the equilibria of
/// `fabric`, W the weights that the noise of the clips makes (force_weights.h). Friction of cords,
/// where the capture has it, is one more unknown, of which nothing is known. Throws Error as
/// check(), and where a frame has no equilibrium or nothing is compared.
MatX mechanical_information(const CandidateTest& test, const Fabric& fabric,
                            const MechanicalInformationOptions& options = {});
MatX mechanical_information(const CandidateCapture& capture, const Fabric& fabric,
                            const MechanicalInformationOptions& options = {});

}  // namespace weft
