#pragma once
#include <array>
#include <vector>

#include "weft/mesh/triangle_mesh.h"

namespace weft {

/// A smooth surface through the vertices of a triangle mesh: curved PN triangles (Vlachos, Peters,
/// Boyd and Mitchell 2001, "Curved PN triangles", section 3): on each triangle a cubic Bezier patch
/// from positions and normals of its three vertices, and a quadratic normal. It is sampled on a
/// regular grid of each triangle. Points on a shared edge exist once, so the sampled surface has no
/// cracks. The rim of the mesh is a cubic curve as every other edge; normals there are the mean of
/// the triangles inside, so the surface flattens towards the rim, as a free edge of cloth does.
class SmoothSurface {
 public:
  /// Each triangle becomes subdivision^2 ones, 1 to 16 (1: the mesh itself). Throws Error
  /// otherwise, and for an invalid mesh.
  SmoothSurface(const TriangleMesh& mesh, int subdivision);

  /// Samples the surface through `x`, 3 x vertices of the mesh. Allocates nothing.
  void evaluate(const Points& x);

  /// Samples, m: first the vertices of the mesh, then points on edges, then inside triangles.
  const Points& points() const { return points_; }
  /// Unit normals, (x1 - x0) x (x2 - x0) of the triangles (0, 1, 2) around.
  const Points& normals() const { return normals_; }
  /// Wound as the triangles of the mesh.
  const std::vector<std::array<int, 3>>& triangles() const { return triangles_; }

 private:
  struct Edge {
    std::array<int, 2> vertices;
  };
  struct Face {
    std::array<int, 3> vertices;
    std::array<int, 3> edges;      ///< (0,1), (1,2), (2,0)
    std::array<bool, 3> reversed;  ///< the edge runs against the winding
  };
  struct EdgeCurve {
    std::array<Vec3, 2> control;  ///< the two inner control points
    Vec3 normal;                  ///< middle control normal
  };
  struct InnerWeights {
    std::array<double, 10> position;
    std::array<double, 6> normal;
  };

  void build_topology(const TriangleMesh& mesh);
  void build_triangles();
  void build_weights();
  int sample(int face, int i, int j) const;
  void evaluate_vertices(const Points& x);
  void evaluate_edges();
  void evaluate_faces();

  int subdivision_;
  int vertex_count_;
  std::vector<Edge> edges_;
  std::vector<Face> faces_;
  std::vector<std::array<int, 3>> triangles_;
  std::vector<InnerWeights> inner_;  ///< one an inner sample of a triangle
  std::vector<EdgeCurve> curves_;
  Points points_, normals_;
};

}  // namespace weft
