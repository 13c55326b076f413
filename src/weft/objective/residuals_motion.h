#pragma once
#include <array>
#include <vector>

#include "weft/optics/render.h"

namespace weft::detail {

/// What moving the vertices does to the picture of the stripes, to first order, without rendering.
///
/// phi, the projector row that lights a vertex, is interpolated linearly over the image of each
/// triangle. The area-weighted mean of its image gradient over the triangles around a vertex,
///
///     h = sum over triangles of adj(E) dphi,   E = (edges in the image), dphi = (phi along them),
///
/// is across the stripes; angle = arg h + pi / 2, and its derivative is that of this formula. It
/// belongs to the vertex. At a fixed pixel the picture moves past as well:
/// d angle(pixel) = d angle(vertex) - (gradient of the angle map) . (motion of the vertex's image).
class StripeMotion {
 public:
  StripeMotion(const Rig& rig, const TriangleMesh& mesh);

  /// Finds the triangle that each pixel of the image sees. Vertices behind the camera leave their
  /// triangles out.
  void look(const Points& x);
  /// Derivatives by `directions`, 3 vertices x n, at the shape last looked at.
  void move(const Points& x, const MatX& directions);

  /// -1: no cloth.
  int triangle(int row, int column) const {
    return seen_[static_cast<std::size_t>(row * width_ + column)];
  }
  /// Derivatives at a pixel of `triangle`, interpolated from its vertices: turn of the stripes
  /// (rad), motion of the surface's image (px), and of the projector row that lights it (px); n
  /// numbers each, per unit of the directions.
  struct Rates {
    VecX turn, right, down, row;
  };
  /// `row` and `column` of the pixel, its centre half a pixel further; may be fractions.
  void rates(int triangle, double row, double column, Rates& out) const;

 private:
  struct Edges;
  void draw(int triangle);

  const Rig& rig_;
  const TriangleMesh& mesh_;
  int width_, height_;
  Points image_;               ///< x, y, depth of each vertex
  std::vector<double> phase_;  ///< projector row of each vertex
  std::vector<int> seen_;
  std::vector<float> nearness_;  ///< 1 / depth
  MatX turn_, right_, down_;     ///< n x vertices
  MatX row_;                     ///< n x vertices: derivative of phase_
  MatX across_x_, across_y_;     ///< n x vertices: derivative of h
};

}  // namespace weft::detail
