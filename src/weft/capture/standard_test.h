#pragma once
/// The standard tests that have a short form (docs/formats.md), as mechanical captures: a specimen,
/// its first material axis along the pull or away from the clamp, clips across its whole width.
#include "weft/base/toml_reader.h"
#include "weft/capture/mechanical_capture.h"

namespace weft {

// Valid ranges of their keys.
inline constexpr Range kGrainAngle{-360, 360};         // degrees
inline constexpr Range kClampAngle{-80, 80};           // degrees
inline constexpr Range kOverhang{1e-3, 1};             // m
inline constexpr Range kOverhangAngle{1, 74};          // degrees
inline constexpr Range kOverhangDeviation{1e-6, 0.1};  // m
inline constexpr int kMostOverhangs = 1000;            // readings
inline constexpr Range kClipNoise{0, most_clip_noise};
inline constexpr int kLeastProfile = 8;  // points
/// Clips further apart than this many times their distance on the undeformed swatch are a mistake,
/// of the unit as a rule.
inline constexpr double kMaxClipStretch = 3;

struct Specimen {
  double free_length = 0;    ///< between the jaws, or beyond the clamp, m
  double width = 0;          ///< m
  double areal_density = 0;  ///< kg/m^2
  double grain_angle = 0;    ///< from the first material axis to the weft, rad
};

/// Two clips across the specimen, without gravity, of which the second moves along the first
/// material axis: by `displacement`, m, frame by frame. Of its force only the component along the
/// pull counts as measured: `force`, N, as many.
MechanicalCapture strip_capture(const Specimen& specimen, const VecX& displacement,
                                const VecX& force);

/// A square of `specimen.width`, whose free length is the same, that a frame of bars shears,
/// without gravity. `force`: of the crosshead, N, one a frame.
MechanicalCapture picture_frame_capture(const Specimen& specimen, PictureFrame frame,
                                        const VecX& force);

/// A strip in a clamp that points `clamp_angle` (rad) below the horizontal, under gravity. `root`:
/// where it leaves the clamp, (x, z), m. No forces.
MechanicalCapture cantilever_capture(const Specimen& specimen, double clamp_angle,
                                     const Vec2& root);
/// Its shape in the one frame, measured along its line and the same across the strip: `line`, (x,
/// z), m, at the arc lengths `arc`, m from the clamp, increasing.
MeasuredGeometry cantilever_geometry(const MechanicalCapture& capture, const VecX& arc,
                                     const MaterialPoints& line);

/// A strip that overhangs a horizontal edge by the mean of what was read, under gravity. The
/// specimen's free length is not read.
MechanicalCapture overhang_capture(const Specimen& specimen, OverhangTest test);

/// Factor to SI from the unit that `key` of `table` names, the first of `units` where it is left
/// out. Throws Error for one that is not among them.
double unit_factor(const TomlTable& table, std::string_view key,
                   const std::vector<std::pair<std::string, double>>& units);
/// Factor to m, of "m", "mm" or "cm".
double length_factor(const TomlTable& table, std::string_view key);

}  // namespace weft
