#pragma once
/// Numbers that describe the shape of a cloth on a grid (Larionov et al. 2022, section 3.4.2,
/// equation 9), with their derivatives. A simulation and a scan are compared by them.
#include <memory>
#include <string_view>
#include <vector>

#include "weft/base/types.h"
#include "weft/mesh/triangle_mesh.h"

namespace weft {

enum class DescriptorKind {
  /// s = p: the coordinates of the vertices, m.
  position,
  /// Green strain (E_uu, E_vv, 2 E_uv) of each triangle, then the angle of each hinge, rad.
  strain,
  /// Membrane energy of each triangle, then bending energy of each hinge, J: 1/2 A E^T C E and 1/2
  /// D_n l^2 / (A_1 + A_2) theta^2 with D_n the bending rigidity across the hinge. Depends on the
  /// material, also for the target.
  energy,
  /// Magnitudes of the two-dimensional discrete Fourier transform of each coordinate over the grid,
  /// m: |F_ab| with F_ab = N^-1/2 sum_ij w x_ij e^{-2 pi i (a i / columns + b j / rows)}. The
  /// phase,
  /// that is the place and the sign of a wrinkle, is gone.
  fourier,
};
/// "position", "strain", "energy", "fourier". Throws Error for another name.
DescriptorKind descriptor_from_name(std::string_view name);
std::string_view name_of(DescriptorKind kind);

/// A grid of columns x rows vertices as make_swatch numbers them, equally spaced for `fourier` to
/// be a transform, and how sure each of its points is.
struct DescriptorGrid {
  TriangleMesh mesh;
  int columns = 0, rows = 0;
  /// 1: measured, 0: not; a number a vertex, empty: all 1. What rests on a vertex of weight w
  /// counts by w (by the least one of its vertices).
  VecX weights;
};

/// Entries of a descriptor with their derivatives.
class ShapeDescriptor {
 public:
  virtual ~ShapeDescriptor() = default;
  virtual Eigen::Index size() const = 0;
  /// How many numbers the entries count as: the sum of the squares of their weights, size() where
  /// all of the grid is measured. Independent noise on the vertices makes
  /// sum (entry / noise)^2 of that size; of magnitudes about so where weights differ, since what a
  /// mask makes of the shape and of its noise is alike.
  virtual double counted() const = 0;
  /// Whether it reads `material` below, which then must be of model "stvk": `energy` alone.
  virtual bool depends_on_material() const { return false; }
  /// `x` 3 x vertices, m; `material`: the values of a fabric.
  virtual VecX value(const Points& x, const VecX& material) const = 0;
  /// d value / d parameters (size x parameters) from d x / d parameters (3 vertices x parameters,
  /// rows as flat(x)), and what the parameters change at fixed x; parameters are the values of the
  /// fabric. `x_derivative` without columns: of a target, which does not move.
  virtual MatX derivative(const Points& x, const VecX& material,
                          const MatX& x_derivative) const = 0;
  /// Standard deviation of each entry, to first order about x, when every coordinate has
  /// independent noise of standard deviation `sigma`, m.
  virtual VecX noise(const Points& x, const VecX& material, double sigma) const = 0;
};

/// `smoothing` (m, >= 0; of `fourier` alone): the magnitude is sqrt(|F|^2 + smoothing^2), which has
/// a derivative everywhere. Noise of standard deviation sigma a coordinate makes the expected
/// |F|^2 of a measured shape larger by sigma^2 times the mean of the squared weights (its
/// coefficients have that variance): with that for smoothing^2 in the simulation, which
/// smoothing = sigma stands for, and 0 for the scan both have the same mean square.
///
/// `fourier` has one entry for each pair of conjugate coefficients, times sqrt(2), so that the sum
/// of squares is that of all vertices (Parseval), and the noise of an entry is sigma where all
/// vertices are measured.
///
/// Throws Error for a grid whose sizes do not fit together, weights outside [0, 1] and smoothing
/// that is negative or not finite.
std::unique_ptr<ShapeDescriptor> make_shape_descriptor(DescriptorKind kind,
                                                       const DescriptorGrid& grid,
                                                       double smoothing = 0);

}  // namespace weft
