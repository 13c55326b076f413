#include "weft/model/sheet_law.h"

namespace weft::detail {
namespace {

class OrthotropicLaw final : public SheetLaw {
 public:
  explicit OrthotropicLaw(double shear_factor) : shear_factor_(shear_factor) {}

  int parameter_count() const override { return 4; }

  void set_parameters(const Eigen::Ref<const VecX>& values) override {
    stiffness_ << values[0], values[1], 0,  //
        values[1], values[2], 0,            //
        0, 0, shear_factor_ * values[3];
  }

  SheetResponse respond(const Vec3& c) const override {
    const Vec3 stress = stiffness_ * c;
    return {0.5 * stress.dot(c), stress, stiffness_};
  }

  void stress_derivative(const Vec3& c, Eigen::Ref<Eigen::Matrix3Xd> derivative) const override {
    derivative << c[0], c[1], 0, 0,  //
        0, c[0], c[1], 0,            //
        0, 0, 0, shear_factor_ * c[2];
  }

 private:
  double shear_factor_;
  Mat3 stiffness_ = Mat3::Zero();
};

}  // namespace

std::unique_ptr<SheetLaw> make_orthotropic_law(double shear_factor) {
  return std::make_unique<OrthotropicLaw>(shear_factor);
}

}  // namespace weft::detail
