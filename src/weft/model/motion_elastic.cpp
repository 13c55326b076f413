#include "weft/model/motion_elastic.h"

#include "weft/model/cloth_model.h"
#include "weft/model/sheet_model.h"

namespace weft::detail {
namespace {

/// Makes areas of masses; gravity is not looked at.
constexpr double kUnitDensity = 1;  // kg/m^2

class MotionElastic final : public ElasticModel {
 public:
  MotionElastic(const TriangleMesh& mesh, const Fabric& fabric, double grain_angle,
                double hem_width)
      : mesh_(mesh),
        fabric_(fabric),
        model_(along_the_threads(mesh, grain_angle), fabric, kUnitDensity, Vec3::Zero(),
               hem_width) {}

  const TriangleMesh& mesh() const override { return mesh_; }
  VecX vertex_areas() const override { return model_.masses() / kUnitDensity; }
  const VecX& parameters() const override { return fabric_.values; }
  void set_parameters(const VecX& values) override {
    Fabric fabric = fabric_;
    fabric.values = values;
    model_.set_fabric(fabric);
    fabric_ = std::move(fabric);
  }

  double energy(const Points& x) const override { return model_.elastic_energy(x); }
  void gradient(const Points& x, Points& gradient) const override {
    model_.potential_gradient(x, {}, gradient);
  }
  void hessian(const Points& x, HessianKind kind, Points& gradient,
               SparseMatrix& hessian) const override {
    model_.potential_hessian(x, {}, kind, gradient, hessian);
  }
  const SparseMatrix& hessian_pattern() const override { return model_.hessian_pattern(); }

  void parameter_derivative(const Points& x, MatX& derivative) const override {
    const Points at_rest = Points::Zero(3, x.cols());
    Points force;
    derivative.resize(x.size(), fabric_.values.size());
    for (int i = 0; i < fabric_.values.size(); ++i) {
      model_.force_derivative(x, at_rest, i, force);
      derivative.col(i) = -Eigen::Map<const VecX>(force.data(), force.size());
    }
  }

 private:
  TriangleMesh mesh_;
  Fabric fabric_;
  ClothModel model_;
};

}  // namespace

std::unique_ptr<ElasticModel> make_motion_elastic(const TriangleMesh& mesh, const Fabric& fabric,
                                                  double grain_angle, double hem_width) {
  return std::make_unique<MotionElastic>(mesh, fabric, grain_angle, hem_width);
}

}  // namespace weft::detail
