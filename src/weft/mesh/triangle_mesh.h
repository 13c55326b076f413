#pragma once
#include <array>
#include <string_view>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// A piece of fabric: triangles over vertices that know where they lie on the undeformed, flat
/// fabric. Material coordinates are (u, v) in m; u runs along the weft, v along the warp.
struct TriangleMesh {
  MaterialPoints material;                    ///< 2 x vertices, m
  std::vector<std::array<int, 3>> triangles;  ///< counter-clockwise in (u, v): positive area

  int vertex_count() const { return static_cast<int>(material.cols()); }
  int triangle_count() const { return static_cast<int>(triangles.size()); }
};

/// How the quads of a grid are split.
enum class GridPattern {
  alternating,  ///< the diagonal changes direction from quad to quad: no preferred diagonal
  uniform,      ///< every diagonal runs the same way
};

/// "alternating", "uniform". Throws Error for another name.
GridPattern grid_pattern_from_name(std::string_view name);
std::string_view name_of(GridPattern pattern);

/// A rectangular swatch of `columns` x `rows` vertices. Vertex k = row * columns + column; row 0 is
/// v = 0, column 0 is u = 0. Throws Error unless width, height > 0 and columns, rows >= 2.
TriangleMesh make_swatch(double width, double height, int columns, int rows,
                         GridPattern pattern = GridPattern::alternating);

/// Area of triangle t on the undeformed fabric, m^2 (signed, positive if counter-clockwise in (u,
/// v)).
double material_area(const TriangleMesh& mesh, int t);

/// Throws Error if an index is out of range, a triangle is degenerate or clockwise, an edge has
/// more than two triangles or two that overlap in (u, v), or a vertex belongs to no triangle.
/// `name` says in the message which mesh it is.
void validate(const TriangleMesh& mesh, std::string_view name);

/// Two triangles that share an edge. The edge runs from vertices[0] to vertices[1]; vertices[2] is
/// the apex of the triangle in which the edge runs counter-clockwise, vertices[3] of the other one.
struct Hinge {
  std::array<int, 4> vertices;
};
std::vector<Hinge> hinges(const TriangleMesh& mesh);

/// Lumped areas, m^2: of a grid a quarter of each cell to each of its corners, however the cells
/// are split; of other meshes a third of each triangle to each of its vertices. (Thirds on an
/// alternating grid would be twice as heavy at every other vertex.)
VecX vertex_areas(const TriangleMesh& mesh);

/// Vertex normals of a deformed mesh: 3 x vertices, unit length, weighted by the area of the
/// deformed triangles. They point along x_u cross x_v, that is, to the side from which the
/// triangles of the mesh (counter-clockwise in (u, v)) run counter-clockwise. A swatch that hangs
/// with u along +x and v along -z has the normal +y: away from a viewer at -y who sees u run right
/// and v run down. A vertex whose triangles have all collapsed has the normal 0.
Points vertex_normals(const TriangleMesh& mesh, const Points& x);

/// Finds (u, v) in a mesh. Keeps a uniform grid over the triangles, and a pointer to the mesh,
/// which must outlive it.
class MaterialLocator {
 public:
  explicit MaterialLocator(const TriangleMesh& mesh);
  struct Hit {
    int triangle;
    Vec3 barycentric;  ///< weights of the triangle's three vertices
  };
  /// The triangle that holds `uv`; for a point outside the mesh (rounding at the rim) the nearest
  /// one, with weights clamped to it. Weights are >= 0 and sum to 1.
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
