#include "weft/objective/residuals_motion.h"

#include <algorithm>
#include <cmath>

namespace weft::detail {
namespace {

/// Row `row` of the derivative of a projection's image coordinates at a point with image (x, y, w).
Vec3 image_gradient(const Projection& projection, int row, double coordinate, double w) {
  return (projection.block<1, 3>(row, 0) - coordinate * projection.block<1, 3>(2, 0)).transpose() /
         w;
}

}  // namespace

StripeMotion::StripeMotion(const Rig& rig, const TriangleMesh& mesh)
    : rig_(rig),
      mesh_(mesh),
      width_(rig.width),
      height_(rig.height),
      image_(3, mesh.vertex_count()),
      phase_(static_cast<std::size_t>(mesh.vertex_count())),
      seen_(static_cast<std::size_t>(width_ * height_)),
      nearness_(seen_.size()) {}

void StripeMotion::look(const Points& x) {
  for (Eigen::Index v = 0; v < x.cols(); ++v) {
    image_.col(v) = rig_.camera.project(x.col(v));
    phase_[static_cast<std::size_t>(v)] = rig_.projector.project(x.col(v)).y();
  }
  std::fill(seen_.begin(), seen_.end(), -1);
  std::fill(nearness_.begin(), nearness_.end(), 0.0f);
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) draw(static_cast<int>(t));
}

void StripeMotion::draw(int triangle) {
  const auto& corner = mesh_.triangles[static_cast<std::size_t>(triangle)];
  const Vec3 a = image_.col(corner[0]), b = image_.col(corner[1]), c = image_.col(corner[2]);
  if (!(a.z() > 1e-3 && b.z() > 1e-3 && c.z() > 1e-3)) return;
  const double area = (b.x() - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (b.y() - a.y());
  if (!(std::abs(area) > 1e-9)) return;
  const int top = std::max(0, int(std::ceil(std::min({a.y(), b.y(), c.y()}) - 0.5)));
  const int bottom = std::min(height_ - 1, int(std::floor(std::max({a.y(), b.y(), c.y()}) - 0.5)));
  const int left = std::max(0, int(std::ceil(std::min({a.x(), b.x(), c.x()}) - 0.5)));
  const int right = std::min(width_ - 1, int(std::floor(std::max({a.x(), b.x(), c.x()}) - 0.5)));
  for (int i = top; i <= bottom; ++i) {
    for (int j = left; j <= right; ++j) {
      const double px = j + 0.5, py = i + 0.5;
      const double wb = ((px - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (py - a.y())) / area;
      const double wc = ((b.x() - a.x()) * (py - a.y()) - (px - a.x()) * (b.y() - a.y())) / area;
      const double wa = 1 - wb - wc;
      if (wa < 0 || wb < 0 || wc < 0) continue;
      const auto nearness = float(wa / a.z() + wb / b.z() + wc / c.z());
      const auto at = static_cast<std::size_t>(i * width_ + j);
      if (nearness <= nearness_[at]) continue;
      nearness_[at] = nearness;
      seen_[at] = triangle;
    }
  }
}

void StripeMotion::move(const Points& x, const MatX& directions) {
  const Eigen::Index n = directions.cols(), count = x.cols();
  row_.resize(n, count);
  right_.resize(n, count);
  down_.resize(n, count);
  const Projection& camera = rig_.camera.projection();
  const Projection& projector = rig_.projector.projection();
  for (Eigen::Index v = 0; v < count; ++v) {
    const auto motion = directions.middleRows<3>(3 * v);
    const Vec3 lit = rig_.projector.project(x.col(v));
    const double camera_w = camera.row(2).head<3>().dot(x.col(v)) + camera(2, 3);
    const double projector_w = projector.row(2).head<3>().dot(x.col(v)) + projector(2, 3);
    right_.col(v) = motion.transpose() * image_gradient(camera, 0, image_(0, v), camera_w);
    down_.col(v) = motion.transpose() * image_gradient(camera, 1, image_(1, v), camera_w);
    row_.col(v) = motion.transpose() * image_gradient(projector, 1, lit.y(), projector_w);
  }

  Eigen::Matrix2Xd across = Eigen::Matrix2Xd::Zero(2, count);
  across_x_.setZero(n, count);
  across_y_.setZero(n, count);
  VecX dx(n), dy(n);
  for (const auto& corner : mesh_.triangles) {
    const int a = corner[0], b = corner[1], c = corner[2];
    const double bx = image_(0, b) - image_(0, a), by = image_(1, b) - image_(1, a);
    const double cx = image_(0, c) - image_(0, a), cy = image_(1, c) - image_(1, a);
    const double pb = phase_[static_cast<std::size_t>(b)] - phase_[static_cast<std::size_t>(a)];
    const double pc = phase_[static_cast<std::size_t>(c)] - phase_[static_cast<std::size_t>(a)];
    // The sign of the area: triangles seen from behind count like those seen from the front.
    const double side = bx * cy - cx * by > 0 ? 1 : -1;
    const Vec2 h = side * Vec2(cy * pb - by * pc, bx * pc - cx * pb);
    dx = side * ((down_.col(c) - down_.col(a)) * pb + cy * (row_.col(b) - row_.col(a)) -
                 (down_.col(b) - down_.col(a)) * pc - by * (row_.col(c) - row_.col(a)));
    dy = side * ((right_.col(b) - right_.col(a)) * pc + bx * (row_.col(c) - row_.col(a)) -
                 (right_.col(c) - right_.col(a)) * pb - cx * (row_.col(b) - row_.col(a)));
    for (const int v : {a, b, c}) {
      across.col(v) += h;
      across_x_.col(v) += dx;
      across_y_.col(v) += dy;
    }
  }
  turn_.resize(n, count);
  for (Eigen::Index v = 0; v < count; ++v) {
    const double square = across.col(v).squaredNorm();
    if (square > 1e-12)
      turn_.col(v) = (across(0, v) * across_y_.col(v) - across(1, v) * across_x_.col(v)) / square;
    else
      turn_.col(v).setZero();
  }
}

void StripeMotion::rates(int triangle, double row, double column, Rates& out) const {
  const auto& corner = mesh_.triangles[static_cast<std::size_t>(triangle)];
  const Vec3 a = image_.col(corner[0]), b = image_.col(corner[1]), c = image_.col(corner[2]);
  const double px = column + 0.5, py = row + 0.5;
  const double area = (b.x() - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (b.y() - a.y());
  const double wb = ((px - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (py - a.y())) / area;
  const double wc = ((b.x() - a.x()) * (py - a.y()) - (px - a.x()) * (b.y() - a.y())) / area;
  const double wa = 1 - wb - wc;
  const auto mix = [&](const MatX& values, VecX& mixed) {
    mixed = wa * values.col(corner[0]) + wb * values.col(corner[1]) + wc * values.col(corner[2]);
  };
  mix(turn_, out.turn);
  mix(right_, out.right);
  mix(down_, out.down);
  mix(row_, out.row);
}

}  // namespace weft::detail
