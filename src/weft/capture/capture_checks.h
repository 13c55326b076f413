#pragma once
/// What must hold between the parts of a capture, beyond the type and range of each key.
#include <vector>

#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/capture/capture.h"
#include "weft/capture/motion_file.h"

namespace weft {

// Valid ranges of the keys of capture.toml (docs/formats.md).
inline constexpr Range kSwatchSide{1e-3, 10};    // m
inline constexpr Range kArealDensity{1e-3, 10};  // kg/m^2
inline constexpr Range kHemWidth{0, 0.1};        // m
inline constexpr Range kGravity{-100, 100};      // m/s^2, each component
inline constexpr Range kFrameRate{0.1, 1e5};     // 1/s
inline constexpr int kMaxFrames = 1'000'000;
inline constexpr int kMinImageSide = 16, kMaxImageSide = 16384;  // px
inline constexpr Range kDistortion{-10, 10};
inline constexpr Range kStripePeriod{1, 1e4};  // projector px
inline constexpr Range kEdgeGain{0.5, 1e4};
inline constexpr Range kBlackLevel{0, 0.95};
inline constexpr Range kProjectorSide{1, 1e5};  // px

/// Fixtures may be at most this many times as far apart as on the undeformed swatch.
inline constexpr double kMaxStretch = 1.1;
/// And at least this many times: cloth is not folded into a point.
inline constexpr double kLeastDistance = 0.01;

/// Where a fixture's motion is named, what it is, and when it was measured.
struct FixtureSamples {
  SourceLocation where, columns_where;
  std::filesystem::path file;
  std::vector<std::string> columns;
  std::vector<double> times;  ///< s
};

/// Throws Error if the file does not exist.
void check_file_exists(const std::filesystem::path& file, const SourceLocation& where);
/// The same of a video, or for numbered images of their folder.
void check_video_exists(const std::filesystem::path& video, const SourceLocation& where);

/// Throws Error unless the motion spans the frames of the video.
void check_covers_video(const Capture& capture, const MotionFile& file);

/// Throws Error if two fixtures are held at one point of the swatch or have one motion, or at a
/// sample or a frame are further apart than the cloth between them can stretch, or in one place.
void check_stretch(const Capture& capture, const std::vector<FixtureSamples>& samples);

/// Median time between the samples of a fixture's motion, s; the longest of all fixtures. 0 where
/// each has but one sample. Reads capture.toml and the files of motion again.
double motion_sample_interval(const Capture& capture);

/// Where the two projections stand.
struct ViewLocations {
  SourceLocation camera, projector;
};
/// Throws Error unless camera and projector have each fixture in front of them at every frame and
/// in their image at the first (the projector: where its size is known).
void check_view(const Capture& capture, const ViewLocations& where);

}  // namespace weft
