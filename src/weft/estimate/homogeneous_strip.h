#pragma once
/// A strip in tension far from its jaws: strained alike everywhere, with free sides. The fast model
/// of a uniaxial test, for every model of a sheet; what jaws do to a short strip is not in it.
#include <memory>
#include <string>
#include <vector>

#include "weft/estimate/least_squares.h"
#include "weft/model/elastic_model.h"

namespace weft {

/// What holds the sides of the strip.
enum class StripSides {
  free,       ///< no stress across, and the cross-section may shear: a long strip
  unsheared,  ///< no stress across; the cross-section stays at right angles to the pull
  held        ///< neither contracts nor shears: a strip much wider than long, or in a wide jaw
};

struct StripState {
  double force = 0;    ///< per width of the undeformed strip, N/m
  double lateral = 1;  ///< width over that of the undeformed strip
  double shear = 0;    ///< shift along the pull by width, of the cross-section
};

/// d W = 0 by lateral stretch and shear, of the density W at the deformation [[stretch, shear],
/// [0, lateral]] with the pull along the first axis. Friction goes along from stretch to stretch,
/// from flat.
class HomogeneousStrip {
 public:
  /// `grain_angle` (rad): u of the material lies at this angle, counter-clockwise, from the pull.
  /// Throws Error for a model that is no sheet's ("springs").
  explicit HomogeneousStrip(const Fabric& fabric, double grain_angle = 0,
                            StripSides sides = StripSides::free);

  /// Values as those of the fabric. Throws Error for values that the model refuses.
  void set_parameters(const VecX& values);

  struct Derivatives {
    MatX force, lateral;  ///< stretches x parameters of the fabric
  };
  /// At each stretch (above 0), in turn, each time from flat. Throws Error where there is no
  /// equilibrium.
  std::vector<StripState> pull(const VecX& stretches, Derivatives* derivatives = nullptr);

 private:
  StripSides sides_;
  std::unique_ptr<ElasticModel> model_;
};

/// One test of a fit.
struct StripTest {
  double grain_angle = 0;  ///< rad
  StripSides sides = StripSides::free;
  VecX stretch;            ///< in the order of the test
  VecX force;              ///< N/m, measured; NaN: not measured
  VecX lateral;            ///< measured width over that at the start, NaN: not; or empty
  double force_noise = 1;  ///< N/m, > 0: what a difference is divided by
  double lateral_noise = 0.01;
};

struct StripFit {
  Fabric fabric;
  double cost = 0;          ///< mean square of the differences, each divided by its noise
  std::vector<VecX> force;  ///< per test, at the fit, N/m
  std::vector<VecX> lateral;
  LeastSquaresResult search;
};
/// Least squares over the parameters `free` of `start` in the coordinates of parameter.h, within
/// their ranges. Throws Error for tests whose sizes differ and where the start has no equilibrium.
StripFit fit_strips(const std::vector<StripTest>& tests, const Fabric& start,
                    const std::vector<std::string>& free, int max_iterations = 100);

/// All control values of a curve (or the one value) of a row, for `free`.
std::vector<std::string> value_names(const Fabric& fabric, std::string_view row);

}  // namespace weft
