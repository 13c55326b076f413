#pragma once
#include <filesystem>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// Grey frames, linear light 0 to 1 (the sRGB transfer curve is undone). `path` is an H.264 (or
/// other FFmpeg-readable) file, or a printf-style pattern of numbered images such as
/// "frames/%04d.png". Throws Error if it cannot be read or has fewer frames than `frame_count`.
std::vector<Image> read_frames(const std::filesystem::path& path, int frame_count);
/// One frame for people to look at: 8-bit, sRGB.
void write_png(const std::filesystem::path& path, const Image& linear);

}  // namespace weft
