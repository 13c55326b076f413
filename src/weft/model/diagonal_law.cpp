#include "weft/model/diagonal_law.h"

#include <cmath>

namespace weft::detail {
namespace {

using Curves = std::array<StiffnessCurve, 3>;

/// A curve over the magnitude of a strain: energy and tangent are even, the stress is odd.
StiffnessCurve::Response over_magnitude(const StiffnessCurve& curve, double c) {
  StiffnessCurve::Response r = curve.respond(std::abs(c));
  if (c < 0) r.stress = -r.stress;
  return r;
}

int total_size(const Curves& curves) {
  return curves[0].size() + curves[1].size() + curves[2].size();
}

/// The values of three curves, one after the other; returns how many there are.
int set_curves(const Eigen::Ref<const VecX>& values, Curves& curves) {
  int first = 0;
  for (StiffnessCurve& curve : curves) {
    curve.set_values(values.segment(first, curve.size()));
    first += curve.size();
  }
  return first;
}

/// One strain as a function of the Green strain, with its derivatives.
struct Measured {
  double value, first, second;
};

Measured measure(StretchStrain kind, double green) {
  if (kind == StretchStrain::green) return {green, 1, 0};
  const double length = std::sqrt(std::max(0.0, 1 + 2 * green));
  // Where the triangle has collapsed along a thread, w = 0, and so is every force w stress.
  const double inverse = length > 1e-9 ? 1 / length : 0;
  return {2 * green / (1 + length), inverse, -inverse * inverse * inverse};
}

class DiagonalMembrane final : public SheetLaw {
 public:
  DiagonalMembrane(const Fabric& fabric, StretchStrain strain)
      : strain_(strain),
        curves_{fabric.curve("weft_stretch"), fabric.curve("warp_stretch"), fabric.curve("shear")},
        couples_(fabric.value_count("stretch_coupling") > 0),
        stiffens_(fabric.value_count("shear_stiffening") > 0) {}

  int parameter_count() const override { return total_size(curves_) + couples_ + stiffens_; }

  void set_parameters(const Eigen::Ref<const VecX>& values) override {
    int next = set_curves(values, curves_);
    if (couples_) coupling_ = values[next++];
    if (stiffens_) stiffening_ = values[next];
  }

  SheetResponse respond(const Vec3& green) const override {
    const State s = state(green);
    SheetResponse out;
    out.energy =
        s.u.energy + s.v.energy + s.factor * s.shear.energy + coupling_ * s.cu.value * s.cv.value;
    // By (c_u, c_v, c_s) first, then by the Green strain.
    const Vec3 stress(s.u.stress + coupling_ * s.cv.value + s.growth_u * s.shear.energy,
                      s.v.stress + coupling_ * s.cu.value + s.growth_v * s.shear.energy,
                      s.factor * s.shear.stress);
    const double bulge = 2 * stiffening_ * s.shear.energy;
    Mat3 h;
    h << s.u.tangent + (s.cu.value > 0 ? bulge : 0), coupling_, s.growth_u * s.shear.stress,
        coupling_, s.v.tangent + (s.cv.value > 0 ? bulge : 0), s.growth_v * s.shear.stress,
        s.growth_u * s.shear.stress, s.growth_v * s.shear.stress, s.factor * s.shear.tangent;
    const Vec3 first(s.cu.first, s.cv.first, 1);
    out.stress = first.cwiseProduct(stress);
    out.stiffness = first.asDiagonal() * h * first.asDiagonal();
    out.stiffness(0, 0) += s.cu.second * stress[0];
    out.stiffness(1, 1) += s.cv.second * stress[1];
    return out;
  }

  void stress_derivative(const Vec3& green, Eigen::Ref<Eigen::Matrix3Xd> d) const override {
    const State s = state(green);
    d.setZero();
    Values basis(StiffnessCurve::kMostKnots);
    int next = 0;
    for (int i = 0; i < 2; ++i) {
      const int n = curves_[at(i)].size();
      const double c = i == 0 ? s.cu.value : s.cv.value;
      curves_[at(i)].stiffness_by_values(c, basis.head(n));
      d.row(i).segment(next, n) = c * basis.head(n).transpose();
      next += n;
    }
    const int n = curves_[2].size();
    curves_[2].stiffness_by_values(std::abs(green[2]), basis.head(n));
    d.row(2).segment(next, n) = s.factor * green[2] * basis.head(n).transpose();
    curves_[2].energy_by_values(std::abs(green[2]), basis.head(n));
    d.row(0).segment(next, n) = s.growth_u * basis.head(n).transpose();
    d.row(1).segment(next, n) = s.growth_v * basis.head(n).transpose();
    next += n;
    if (couples_) {
      d(0, next) = s.cv.value;
      d(1, next++) = s.cu.value;
    }
    if (stiffens_) {
      const double u = std::max(0.0, s.cu.value), v = std::max(0.0, s.cv.value);
      d.col(next) =
          Vec3(2 * u * s.shear.energy, 2 * v * s.shear.energy, (u * u + v * v) * s.shear.stress);
    }
    d.row(0) *= s.cu.first;
    d.row(1) *= s.cv.first;
  }

 private:
  using Values = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, StiffnessCurve::kMostKnots, 1>;

  struct State {
    Measured cu, cv;
    StiffnessCurve::Response u, v, shear;
    double factor, growth_u, growth_v;  ///< F and its derivatives
  };

  State state(const Vec3& green) const {
    State s;
    s.cu = measure(strain_, green[0]);
    s.cv = measure(strain_, green[1]);
    s.u = curves_[0].respond(s.cu.value);
    s.v = curves_[1].respond(s.cv.value);
    s.shear = over_magnitude(curves_[2], green[2]);
    const double u = std::max(0.0, s.cu.value), v = std::max(0.0, s.cv.value);
    s.factor = 1 + stiffening_ * (u * u + v * v);
    s.growth_u = 2 * stiffening_ * u;
    s.growth_v = 2 * stiffening_ * v;
    return s;
  }

  StretchStrain strain_;
  Curves curves_;
  bool couples_, stiffens_;
  double coupling_ = 0, stiffening_ = 0;
};

class DiagonalBending final : public SheetLaw {
 public:
  explicit DiagonalBending(const Fabric& fabric)
      : curves_{fabric.curve("weft_bend"), fabric.curve("warp_bend"),
                fabric.curve("diagonal_bend")} {}

  int parameter_count() const override { return total_size(curves_); }
  void set_parameters(const Eigen::Ref<const VecX>& values) override {
    set_curves(values, curves_);
  }

  SheetResponse respond(const Vec3& curvature) const override {
    SheetResponse out{0, Vec3::Zero(), Mat3::Zero()};
    for (int i = 0; i < 3; ++i) {
      const auto r = over_magnitude(curves_[at(i)], curvature[i]);
      out.energy += r.energy;
      out.stress[i] = r.stress;
      out.stiffness(i, i) = r.tangent;
    }
    return out;
  }

  void stress_derivative(const Vec3& curvature, Eigen::Ref<Eigen::Matrix3Xd> d) const override {
    d.setZero();
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, StiffnessCurve::kMostKnots, 1> basis(
        StiffnessCurve::kMostKnots);
    int next = 0;
    for (int i = 0; i < 3; ++i) {
      const int n = curves_[at(i)].size();
      curves_[at(i)].stiffness_by_values(std::abs(curvature[i]), basis.head(n));
      d.row(i).segment(next, n) = curvature[i] * basis.head(n).transpose();
      next += n;
    }
  }

 private:
  Curves curves_;
};

}  // namespace

std::unique_ptr<SheetLaw> make_diagonal_membrane(const Fabric& fabric, StretchStrain strain) {
  return std::make_unique<DiagonalMembrane>(fabric, strain);
}

std::unique_ptr<SheetLaw> make_diagonal_bending(const Fabric& fabric) {
  return std::make_unique<DiagonalBending>(fabric);
}

}  // namespace weft::detail
