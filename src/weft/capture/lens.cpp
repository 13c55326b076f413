#include "weft/capture/lens.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace weft {

Mat3 camera_matrix(const Pinhole& camera) {
  // The projection is scaled so that its third row is a unit vector: Gram-Schmidt from below.
  const Mat3 a = camera.projection().leftCols<3>();
  const Vec3 a1 = a.row(0), a2 = a.row(1), r3 = a.row(2);
  Mat3 k = Mat3::Identity();
  k(0, 2) = a1.dot(r3);
  k(1, 2) = a2.dot(r3);
  const Vec3 a2_rest = a2 - k(1, 2) * r3;
  k(1, 1) = a2_rest.norm();
  const Vec3 r2 = a2_rest / k(1, 1);
  k(0, 1) = a1.dot(r2);
  k(0, 0) = (a1 - k(0, 2) * r3 - k(0, 1) * r2).norm();
  return k;
}

Vec2 distort(const Mat3& camera_matrix, const LensDistortion& lens, const Vec2& pixel) {
  const double y = (pixel.y() - camera_matrix(1, 2)) / camera_matrix(1, 1);
  const double x =
      (pixel.x() - camera_matrix(0, 2) - camera_matrix(0, 1) * y) / camera_matrix(0, 0);
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
  const Vec3 distorted(x * radial + 2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x),
                       y * radial + lens.p1 * (r2 + 2 * y * y) + 2 * lens.p2 * x * y, 1);
  return (camera_matrix * distorted).head<2>();
}

Image undistort(const Image& image, const Pinhole& camera, const LensDistortion& lens) {
  const Mat3 k = camera_matrix(camera);
  const int rows = static_cast<int>(image.rows()), columns = static_cast<int>(image.cols());
  cv::Mat map_x(rows, columns, CV_32F), map_y(rows, columns, CV_32F);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const Vec2 source = distort(k, lens, Vec2(j + 0.5, i + 0.5));
      // OpenCV counts from the first pixel's centre.
      map_x.at<float>(i, j) = static_cast<float>(source.x() - 0.5);
      map_y.at<float>(i, j) = static_cast<float>(source.y() - 0.5);
    }
  }
  Image result(rows, columns);
  const cv::Mat source(rows, columns, CV_32F, const_cast<float*>(image.data()));
  cv::Mat target(rows, columns, CV_32F, result.data());
  cv::remap(source, target, map_x, map_y, cv::INTER_LINEAR, cv::BORDER_CONSTANT, 0);
  return result;
}

}  // namespace weft
