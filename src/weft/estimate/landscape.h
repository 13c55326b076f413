#pragma once
#include <functional>
#include <string>

#include "weft/estimate/evaluation_store.h"
#include "weft/estimate/problem.h"

namespace weft {

/// The error over a grid of two free parameters (Bhat 2003, figure 3), or along one, the others as
/// in `fabric`.
struct LandscapeOptions {
  std::string x_parameter = "stretch_stiffness";
  std::string y_parameter = "bend_stiffness";  ///< empty: along x alone
  int x_count = 16, y_count = 16;   ///< 2 to 1000 values, equally spaced in scaled coordinates
  double x_lower = 0, x_upper = 1;  ///< scaled, both ends included
  double y_lower = 0, y_upper = 1;
  int frame_count = 1;  ///< compared frames; 0: all. The paper uses the first.
  int threads = 0;
};

struct Landscape {
  std::string x_parameter, y_parameter;
  std::vector<double> x, y;  ///< parameter values, SI; y empty along x alone
  MatX error;                ///< y_count (or 1) x x_count; infinity where diverged or not evaluated
  bool stopped = false;
};
/// `observer(done, total)` after each point, from one thread at a time; false stops.
Landscape landscape(const Problem& problem, const Fabric& fabric, const LandscapeOptions& options,
                    EvaluationStore* store = nullptr,
                    const std::function<bool(std::size_t, std::size_t)>& observer = {});

}  // namespace weft
