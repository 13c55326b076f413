#pragma once
#include <array>
#include <string_view>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// A piece of fabric: triangles over vertices that know where they lie on the undeformed, flat fabric.
/// Material coordinates are (u, v) in m; u runs along the weft, v along the warp.
struct TriangleMesh {
  MaterialPoints material;                  ///< 2 x vertices, m
  std::vector<std::array<int, 3>> triangles;  ///< counter-clockwise in (u, v): positive area

  int vertex_count() const { return static_cast<int>(material.cols()); }
  int triangle_count() const { return static_cast<int>(triangles.size()); }
};

/// How the quads of a grid are split.
enum class GridPattern {
  alternating,  ///< the diagonal changes direction from quad to quad: no preferred diagonal
  uniform,      ///< every diagonal runs the same way
};

/// A rectangular swatch of `columns` x `rows` vertices. Vertex k = row * columns + column; row 0 is
/// v = 0, column 0 is u = 0. Throws Error unless width, height > 0 and columns, rows >= 2.
TriangleMesh make_swatch(double width, double height, int columns, int rows,
                         GridPattern pattern = GridPattern::alternating);

/// Area of triangle t on the undeformed fabric, m^2 (signed, positive if counter-clockwise in (u, v)).
double material_area(const TriangleMesh& mesh, int t);

/// Throws Error if an index is out of range, a triangle is degenerate or clockwise, an edge has more
/// than two triangles, or a vertex belongs to no triangle.
void validate(const TriangleMesh& mesh, std::string_view name);

/// Two triangles that share an edge. The edge runs from vertices[0] to vertices[1]; vertices[2] is
/// the apex of the triangle in which the edge runs counter-clockwise, vertices[3] of the other one.
struct Hinge {
  std::array<int, 4> vertices;
};
std::vector<Hinge> hinges(const TriangleMesh& mesh);

/// Lumped areas: a third of each triangle's area to each of its vertices, m^2.
VecX vertex_areas(const TriangleMesh& mesh);

/// Vertex normals of a deformed mesh (area weighted, unit length): 3 x vertices. The front side is the
/// one from which (u right, v down) reads as written: normal = x_u cross x_v, reversed or not as the
/// triangles' orientation in (u, v) says.
Points vertex_normals(const TriangleMesh& mesh, const Points& x);

/// Finds (u, v) in a mesh. Keeps a uniform grid over the triangles.
class MaterialLocator {
 public:
  explicit MaterialLocator(const TriangleMesh& mesh);
  struct Hit {
    int triangle;
    Vec3 barycentric;  ///< weights of the triangle's three vertices
  };
  /// The triangle that holds `uv`; for a point outside the mesh (rounding at the rim) the nearest
  /// one, with weights clamped to it.
  Hit locate(const Vec2& uv) const;

 private:
  const TriangleMesh* mesh_;
  Vec2 origin_;
  double cell_;
  int columns_, rows_;
  std::vector<std::vector<int>> cells_;
};

/// Positions of the surface at the material points `uv`.
Points interpolate(const TriangleMesh& mesh, const MaterialLocator& locator, const Points& x,
                   const MaterialPoints& uv);

}  // namespace weft
