#pragma once
#include <filesystem>
#include <optional>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// Grey frames, linear light 0 to 1 (the sRGB transfer curve is undone). `path` is an H.264 (or
/// other FFmpeg-readable) file, or a printf-style pattern of numbered images such as
/// "frames/%04d.png". Throws Error if it cannot be read or has fewer frames than `frame_count`.
std::vector<Image> read_frames(const std::filesystem::path& path, int frame_count);
/// Frames a second that a video file states; nothing for numbered images and files that state none.
std::optional<double> stated_frame_rate(const std::filesystem::path& path);
/// One frame for people to look at: 8-bit, sRGB.
void write_png(const std::filesystem::path& path, const Image& linear);

}  // namespace weft
