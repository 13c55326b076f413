#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "weft/capture/mechanical_capture.h"

namespace weft {

/// What a mechanical capture has beside its clips.
struct MechanicalFiles {
  std::optional<MeasuredGeometry> geometry;  ///< one shape a frame
  std::string truth;  ///< text of a note on the true parameters (TOML); empty: none
};

/// Writes a capture folder (capture.toml, clips.csv, rest.obj and points.pc2 where there is a
/// shape, truth/parameters.toml where there is a note) that read_mechanical_capture reads back:
/// clips, cords and forces exactly, points rounded to 32-bit floats. `folder`, `geometry` and
/// `truth` of the capture are ignored; name and description are written. Throws Error where a
/// number of frames does not fit, a component of a force is not finite (a clip without forces has
/// no columns), a loaded clip has measured forces or several regions, or a file cannot be written.
void write_mechanical_capture(const std::filesystem::path& folder, const MechanicalCapture& capture,
                              const MechanicalFiles& files = {});

}  // namespace weft
