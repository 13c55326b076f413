#include "weft/objective/shape_descriptor.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "weft/base/error.h"
#include "weft/strain/dihedral_angle.h"
#include "weft/strain/triangle_shape.h"

namespace weft {
namespace {

using Complex = std::complex<double>;
using MatXc = Eigen::MatrixXcd;
constexpr int kMaterial = 8;  // values of "stvk" that the energy depends on
/// A noise below this part of the largest is an entry that the shape hardly moves: it would weigh
/// without bound.
constexpr double kLeastNoise = 1e-3;

constexpr std::pair<DescriptorKind, std::string_view> kNames[] = {
    {DescriptorKind::position, "position"},
    {DescriptorKind::strain, "strain"},
    {DescriptorKind::energy, "energy"},
    {DescriptorKind::fourier, "fourier"}};

double weight_of(const VecX& weights, int vertex) { return weights.size() ? weights[vertex] : 1; }

class PositionDescriptor final : public ShapeDescriptor {
 public:
  explicit PositionDescriptor(const DescriptorGrid& grid)
      : weights_(VecX::Ones(3 * grid.mesh.vertex_count())) {
    for (Eigen::Index i = 0; i < weights_.size(); ++i)
      weights_[i] = weight_of(grid.weights, static_cast<int>(i / 3));
  }
  Eigen::Index size() const override { return weights_.size(); }
  double counted() const override { return weights_.squaredNorm(); }
  VecX value(const Points& x, const VecX&) const override { return weights_.cwiseProduct(flat(x)); }
  MatX derivative(const Points&, const VecX& material, const MatX& dx) const override {
    if (dx.cols() == 0) return MatX::Zero(size(), material.size());
    return weights_.asDiagonal() * dx;
  }
  VecX noise(const Points&, const VecX&, double sigma) const override {
    return VecX::Constant(size(), sigma);
  }

 private:
  VecX weights_;
};

/// An entry that rests on up to four vertices: its value, its gradient and its derivative by the
/// material at fixed positions.
struct LocalEntry {
  double value = 0;
  std::array<Vec3, 4> gradient{Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  std::array<double, kMaterial> material{};
};

struct TriangleElement {
  std::array<int, 3> vertices;
  TriangleShape<double> shape;
  double weight;
};

struct HingeElement {
  std::array<int, 4> vertices;
  /// 1/2 l^2 / (A_1 + A_2), and how the rigidity across the hinge follows from D11, D12, D22, D66.
  double factor;
  std::array<double, 4> rigidity;
  double weight;
};

/// Strain and energy: entries of triangles, then of hinges.
class LocalDescriptor : public ShapeDescriptor {
 public:
  explicit LocalDescriptor(const DescriptorGrid& grid) {
    const MaterialPoints& uv = grid.mesh.material;
    const auto least = [&](const auto& vertices) {
      double weight = 1;
      for (const int v : vertices) weight = std::min(weight, weight_of(grid.weights, v));
      return weight;
    };
    for (const auto& t : grid.mesh.triangles)
      triangles_.push_back({t, triangle_shape(uv.col(t[0]), uv.col(t[1]), uv.col(t[2])), least(t)});
    for (const Hinge& hinge : hinges(grid.mesh)) {
      const auto& v = hinge.vertices;
      const Vec2 edge = uv.col(v[1]) - uv.col(v[0]);
      const double area = triangle_shape(uv.col(v[0]), uv.col(v[1]), uv.col(v[2])).area +
                          triangle_shape(uv.col(v[0]), uv.col(v[1]), uv.col(v[3])).area;
      const Vec2 n = Vec2(edge.y(), -edge.x()).normalized();
      const double uu = n.x() * n.x(), vv = n.y() * n.y();
      hinges_.push_back({v,
                         0.5 * edge.squaredNorm() / area,
                         {uu * uu, 2 * uu * vv, vv * vv, 4 * uu * vv},
                         least(v)});
    }
  }

  double counted() const override {
    double triangles = 0, hinges = 0;
    for (const TriangleElement& t : triangles_) triangles += t.weight * t.weight;
    for (const HingeElement& h : hinges_) hinges += h.weight * h.weight;
    return entries_per_triangle() * triangles + hinges;
  }

  VecX value(const Points& x, const VecX& material) const override {
    VecX result(size());
    for (Eigen::Index i = 0; i < size(); ++i) {
      const Local local = entry(i, x, material);
      result[i] = local.weight * local.entry.value;
    }
    return result;
  }

  MatX derivative(const Points& x, const VecX& material, const MatX& dx) const override {
    MatX result = MatX::Zero(size(), material.size());
    for (Eigen::Index i = 0; i < size(); ++i) {
      const Local local = entry(i, x, material);
      if (dx.cols() > 0)
        for (std::size_t k = 0; k < local.count; ++k)
          result.row(i) += local.weight * local.entry.gradient[k].transpose() *
                           dx.middleRows(3 * local.vertices[k], 3);
      for (Eigen::Index p = 0; p < std::min<Eigen::Index>(kMaterial, material.size()); ++p)
        result(i, p) += local.weight * local.entry.material[at(p)];
    }
    return result;
  }

  VecX noise(const Points& x, const VecX& material, double sigma) const override {
    VecX result(size());
    for (Eigen::Index i = 0; i < size(); ++i) {
      double squares = 0;
      for (const Vec3& g : entry(i, x, material).entry.gradient) squares += g.squaredNorm();
      result[i] = sigma * std::sqrt(squares);
    }
    // Angles and strains have units of their own: each kind against its own largest.
    const Eigen::Index split = triangle_entries();
    for (auto part : {result.head(split), result.tail(size() - split)})
      if (part.size() > 0) part = part.cwiseMax(kLeastNoise * part.maxCoeff());
    return result;
  }

 protected:
  struct Local {
    LocalEntry entry;
    std::array<int, 4> vertices{};
    std::size_t count = 0;
    double weight = 1;
  };
  virtual int entries_per_triangle() const = 0;
  Eigen::Index triangle_entries() const {
    return entries_per_triangle() * static_cast<Eigen::Index>(triangles_.size());
  }
  virtual Local entry(Eigen::Index i, const Points& x, const VecX& material) const = 0;

  static Vec3 green(const TriangleElement& t, const Points& x, Vec3& wu, Vec3& wv) {
    const auto du = t.shape.du(), dv = t.shape.dv();
    wu.setZero();
    wv.setZero();
    for (std::size_t k = 0; k < 3; ++k) {
      wu += du[k] * x.col(t.vertices[k]);
      wv += dv[k] * x.col(t.vertices[k]);
    }
    return {0.5 * (wu.squaredNorm() - 1), 0.5 * (wv.squaredNorm() - 1), wu.dot(wv)};
  }
  /// Gradient of a . (E_uu, E_vv, 2 E_uv).
  static void add_green_gradient(const TriangleElement& t, const Vec3& wu, const Vec3& wv,
                                 const Vec3& a, LocalEntry& entry) {
    const auto du = t.shape.du(), dv = t.shape.dv();
    for (std::size_t k = 0; k < 3; ++k)
      entry.gradient[k] += (a[0] * du[k] + a[2] * dv[k]) * wu + (a[1] * dv[k] + a[2] * du[k]) * wv;
  }
  static double angle(const HingeElement& h, const Points& x, std::array<Vec3, 4>& gradient) {
    const auto point = [&](std::size_t k) {
      const Vec3 p = x.col(h.vertices[k]);
      return Vector3<double>{p.x(), p.y(), p.z()};
    };
    const DihedralAngle<double> angle = dihedral_angle(point(0), point(1), point(2), point(3));
    const auto g = angle.gradient();
    for (std::size_t k = 0; k < 4; ++k) gradient[k] = Vec3(g[k].x, g[k].y, g[k].z);
    return angle.value;
  }

  std::vector<TriangleElement> triangles_;
  std::vector<HingeElement> hinges_;
};

class StrainDescriptor final : public LocalDescriptor {
 public:
  using LocalDescriptor::LocalDescriptor;
  Eigen::Index size() const override {
    return triangle_entries() + static_cast<Eigen::Index>(hinges_.size());
  }

 protected:
  int entries_per_triangle() const override { return 3; }
  Local entry(Eigen::Index i, const Points& x, const VecX&) const override {
    Local local;
    if (i < triangle_entries()) {
      const TriangleElement& t = triangles_[at(i / 3)];
      Vec3 wu, wv;
      local.entry.value = green(t, x, wu, wv)[i % 3];
      add_green_gradient(t, wu, wv, Vec3::Unit(i % 3), local.entry);
      std::copy(t.vertices.begin(), t.vertices.end(), local.vertices.begin());
      local.count = 3;
      local.weight = t.weight;
    } else {
      const HingeElement& h = hinges_[at(i - triangle_entries())];
      local.entry.value = angle(h, x, local.entry.gradient);
      local.vertices = h.vertices;
      local.count = 4;
      local.weight = h.weight;
    }
    return local;
  }
};

class EnergyDescriptor final : public LocalDescriptor {
 public:
  using LocalDescriptor::LocalDescriptor;
  Eigen::Index size() const override {
    return static_cast<Eigen::Index>(triangles_.size() + hinges_.size());
  }
  bool depends_on_material() const override { return true; }

 protected:
  int entries_per_triangle() const override { return 1; }
  Local entry(Eigen::Index i, const Points& x, const VecX& material) const override {
    Local local;
    LocalEntry& e = local.entry;
    if (i < triangle_entries()) {
      const TriangleElement& t = triangles_[at(i)];
      Vec3 wu, wv;
      const Vec3 s = green(t, x, wu, wv);
      // As in the table of "stvk": A11, A12, A22, A66.
      const Vec3 stress(material[0] * s[0] + material[1] * s[1],
                        material[1] * s[0] + material[2] * s[1], material[3] * s[2]);
      const double area = t.shape.area;
      e.value = 0.5 * area * stress.dot(s);
      e.material = {0.5 * area * s[0] * s[0], area * s[0] * s[1], 0.5 * area * s[1] * s[1],
                    0.5 * area * s[2] * s[2]};
      add_green_gradient(t, wu, wv, area * stress, e);
      std::copy(t.vertices.begin(), t.vertices.end(), local.vertices.begin());
      local.count = 3;
      local.weight = t.weight;
    } else {
      const HingeElement& h = hinges_[at(i - triangle_entries())];
      const double theta = angle(h, x, e.gradient);
      double rigidity = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        rigidity += h.rigidity[k] * material[4 + static_cast<Eigen::Index>(k)];
        e.material[4 + k] = h.factor * h.rigidity[k] * theta * theta;
      }
      e.value = h.factor * rigidity * theta * theta;
      for (Vec3& g : e.gradient) g *= 2 * h.factor * rigidity * theta;
      local.vertices = h.vertices;
      local.count = 4;
      local.weight = h.weight;
    }
    return local;
  }
};

class FourierDescriptor final : public ShapeDescriptor {
 public:
  FourierDescriptor(const DescriptorGrid& grid, double smoothing)
      : columns_(grid.columns), rows_(grid.rows), weights_(grid.weights) {
    if (weights_.size() == 0) weights_ = VecX::Ones(grid.mesh.vertex_count());
    mean_square_weight_ = weights_.squaredNorm() / static_cast<double>(weights_.size());
    smoothing_ = smoothing * std::sqrt(mean_square_weight_);
    along_columns_ = transform(columns_);
    along_rows_ = transform(rows_);
    for (int b = 0; b < rows_; ++b)
      for (int a = 0; a < columns_; ++a) {
        const int other_a = (columns_ - a) % columns_, other_b = (rows_ - b) % rows_;
        if (std::pair(other_b, other_a) < std::pair(b, a)) continue;  // the conjugate is there
        kept_.push_back({a, b, other_a == a && other_b == b ? 1 : std::numbers::sqrt2});
      }
  }

  Eigen::Index size() const override { return 3 * static_cast<Eigen::Index>(kept_.size()); }
  double counted() const override { return static_cast<double>(size()) * mean_square_weight_; }

  VecX value(const Points& x, const VecX&) const override {
    VecX result(size());
    Eigen::Index i = 0;
    for (int k = 0; k < 3; ++k) {
      const MatXc f = transformed(x.row(k).transpose());
      for (const Kept& kept : kept_)
        result[i++] = kept.factor * magnitude(f(kept.row, kept.column), smoothing_);
    }
    return result;
  }

  MatX derivative(const Points& x, const VecX& material, const MatX& dx) const override {
    if (dx.cols() == 0) return MatX::Zero(size(), material.size());
    MatX result(size(), dx.cols());
    const auto vertices = static_cast<Eigen::Index>(columns_) * rows_;
    VecX field(vertices);
    for (int k = 0; k < 3; ++k) {
      const MatXc f = transformed(x.row(k).transpose());
      for (Eigen::Index p = 0; p < dx.cols(); ++p) {
        for (Eigen::Index v = 0; v < vertices; ++v) field[v] = dx(3 * v + k, p);
        const MatXc df = transformed(field);
        Eigen::Index i = k * static_cast<Eigen::Index>(kept_.size());
        for (const Kept& kept : kept_) {
          const Complex c = f(kept.row, kept.column), d = df(kept.row, kept.column);
          const double m = magnitude(c, smoothing_);
          result(i++, p) = m > 0 ? kept.factor * (std::conj(c) * d).real() / m : 0;
        }
      }
    }
    return result;
  }

  VecX noise(const Points&, const VecX&, double sigma) const override {
    return VecX::Constant(size(), sigma);
  }

 private:
  struct Kept {
    int column, row;
    double factor;
  };

  static MatXc transform(int n) {
    MatXc m(n, n);
    for (int a = 0; a < n; ++a)
      for (int i = 0; i < n; ++i)
        m(a, i) = std::polar(1 / std::sqrt(n), -2 * std::numbers::pi * a * i / n);
    return m;
  }
  /// rows x columns coefficients of a field over the vertices.
  MatXc transformed(const VecX& field) const {
    using Grid = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const VecX weighted = field.cwiseProduct(weights_);
    const Eigen::Map<const Grid> grid(weighted.data(), rows_, columns_);
    return along_rows_ * grid.cast<Complex>() * along_columns_.transpose();
  }
  static double magnitude(const Complex& c, double smoothing) {
    return std::sqrt(std::norm(c) + smoothing * smoothing);
  }
  int columns_, rows_;
  double smoothing_ = 0;
  VecX weights_;
  double mean_square_weight_ = 1;
  MatXc along_columns_, along_rows_;
  std::vector<Kept> kept_;
};

void check(const DescriptorGrid& grid, double smoothing) {
  const Eigen::Index vertices = grid.mesh.vertex_count();
  if (grid.columns < 2 || grid.rows < 2 ||
      vertices != static_cast<Eigen::Index>(grid.columns) * grid.rows)
    throw Error(fmt::format("a grid of {} x {} vertices cannot have {}", grid.columns, grid.rows,
                            vertices));
  if (grid.weights.size() != 0 && grid.weights.size() != vertices)
    throw Error(fmt::format("{} weights for {} vertices", grid.weights.size(), vertices));
  if (grid.weights.size() != 0 && !(grid.weights.array() >= 0 && grid.weights.array() <= 1).all())
    throw Error("weights of vertices must be within [0, 1]");
  if (!(smoothing >= 0) || !std::isfinite(smoothing))
    throw Error(fmt::format("smoothing is {:g} m, must be at least 0", smoothing));
}

}  // namespace

DescriptorKind descriptor_from_name(std::string_view name) {
  std::string known;
  for (const auto& [kind, text] : kNames) {
    if (text == name) return kind;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", text);
  }
  throw Error(fmt::format("descriptor \"{}\" is not known; known: {}", name, known));
}

std::string_view name_of(DescriptorKind kind) {
  for (const auto& [value, text] : kNames)
    if (value == kind) return text;
  return "";
}

std::unique_ptr<ShapeDescriptor> make_shape_descriptor(DescriptorKind kind,
                                                       const DescriptorGrid& grid,
                                                       double smoothing) {
  check(grid, smoothing);
  switch (kind) {
    case DescriptorKind::position:
      return std::make_unique<PositionDescriptor>(grid);
    case DescriptorKind::strain:
      return std::make_unique<StrainDescriptor>(grid);
    case DescriptorKind::energy:
      return std::make_unique<EnergyDescriptor>(grid);
    case DescriptorKind::fourier:
      break;
  }
  return std::make_unique<FourierDescriptor>(grid, smoothing);
}

}  // namespace weft
