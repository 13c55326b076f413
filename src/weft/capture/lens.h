#pragma once
#include "weft/capture/capture.h"

namespace weft {

/// Camera matrix K (upper triangular, K(2, 2) = 1, positive diagonal) of a projection K [R | t].
Mat3 camera_matrix(const Pinhole& camera);

/// Where the lens puts a point that an ideal pinhole with camera matrix `camera_matrix` would put
/// at `pixel` (continuous image coordinates).
Vec2 distort(const Mat3& camera_matrix, const LensDistortion& lens, const Vec2& pixel);

/// The image that a camera without distortion would have taken; 0 where nothing was seen. Bilinear.
Image undistort(const Image& image, const Pinhole& camera, const LensDistortion& lens);

}  // namespace weft
