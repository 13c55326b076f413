#pragma once
/// The few types that every module shares.
#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>

namespace weft {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using VecX = Eigen::VectorXd;
using MatX = Eigen::MatrixXd;

/// Positions, velocities or forces of n vertices: 3 x n, one column a vertex, contiguous in memory.
using Points = Eigen::Matrix3Xd;
/// (u, v) on the undeformed fabric: 2 x n, m.
using MaterialPoints = Eigen::Matrix2Xd;

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kDegree = std::numbers::pi / 180;  // rad

/// What Eigen and stencils count in int, as the standard library indexes. Not negative.
inline std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

/// Derivatives by up to this many parameters are computed side by side.
inline constexpr int kDirections = 16;
/// Derivatives of a quantity by parameters: a row an entry (for positions 3 vertex + coordinate), a
/// column a parameter. Columns that no parameter uses are zero.
using Directions = Eigen::Matrix<double, Eigen::Dynamic, kDirections, Eigen::RowMajor>;

/// Column-major, 32-bit indices: what Eigen's direct solvers take.
using SparseMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

/// A projection: homogeneous pixel = matrix * (world position in m, 1).
using Projection = Eigen::Matrix<double, 3, 4>;

/// An image plane of `height` rows and `width` columns. Pixel (row i, column j) has its centre at
/// continuous image coordinates (x, y) = (j + 0.5, i + 0.5); x right, y down.
using Image = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
/// 0 or 1 a pixel, laid out as Image.
using Mask = Eigen::Array<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The 3 n numbers of `points` as one vector (a view, nothing is copied).
inline Eigen::Map<VecX> flat(Points& points) { return {points.data(), points.size()}; }
inline Eigen::Map<const VecX> flat(const Points& points) { return {points.data(), points.size()}; }

}  // namespace weft
