#include "weft/estimate/landscape.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <mutex>

#include "weft/base/error.h"
#include "weft/base/parallel.h"

namespace weft {
namespace {

int free_index(const Problem& problem, const std::string& parameter) {
  const int index = problem.index_of(parameter);
  if (index < 0) throw Error(fmt::format("landscape: {} is not a free parameter", parameter));
  return index;
}

void check(const LandscapeOptions& options) {
  const auto check_axis = [](const char* name, int count, double lower, double upper) {
    if (count < 2 || count > 1000)
      throw Error(fmt::format("landscape: {} = {} values, valid: 2 to 1000", name, count));
    if (!(lower >= 0 && lower < upper && upper <= 1))
      throw Error(fmt::format("landscape: {} from {} to {}, valid: 0 <= lower < upper <= 1", name,
                              lower, upper));
  };
  check_axis("x", options.x_count, options.x_lower, options.x_upper);
  if (options.y_parameter.empty()) return;
  check_axis("y", options.y_count, options.y_lower, options.y_upper);
  if (options.x_parameter == options.y_parameter)
    throw Error("landscape: x and y are the same parameter");
}

std::vector<double> axis_values(const ParameterInfo& info, int count, double lower, double upper) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i)
    values.push_back(std::clamp(from_scaled(info, lower + (upper - lower) * i / (count - 1)),
                                info.lower, info.upper));
  return values;
}

}  // namespace

Landscape landscape(const Problem& problem, const Fabric& fabric, const LandscapeOptions& options,
                    EvaluationStore* store,
                    const std::function<bool(std::size_t, std::size_t)>& observer) {
  check(options);
  const ParameterInfo& x_info = problem.info(free_index(problem, options.x_parameter));
  Landscape result;
  result.x_parameter = options.x_parameter;
  result.y_parameter = options.y_parameter;
  result.x = axis_values(x_info, options.x_count, options.x_lower, options.x_upper);
  const int x_index = fabric.value_index(options.x_parameter);
  int y_index = -1;
  if (!options.y_parameter.empty()) {
    const ParameterInfo& y_info = problem.info(free_index(problem, options.y_parameter));
    result.y = axis_values(y_info, options.y_count, options.y_lower, options.y_upper);
    y_index = fabric.value_index(options.y_parameter);
  }
  const std::size_t rows = std::max<std::size_t>(result.y.size(), 1);
  const std::size_t columns = result.x.size(), total = columns * rows;
  result.error = MatX::Constant(static_cast<Eigen::Index>(rows), options.x_count, kInfinity);
  std::mutex mutex;
  std::atomic<bool> stop = false;
  std::size_t done = 0;
  parallel_for(total, options.threads, [&](std::size_t i) {
    if (stop) return;
    const std::size_t row = i / columns, column = i % columns;
    Fabric changed = fabric;
    changed.values[x_index] = result.x[column];
    if (y_index >= 0) changed.values[y_index] = result.y[row];
    const double error =
        evaluate_stored(problem, changed, options.frame_count, "landscape", store).evaluation.error;
    const std::lock_guard lock(mutex);
    result.error(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) = error;
    if (observer && !observer(++done, total)) stop = true;
  });
  result.stopped = stop;
  return result;
}

}  // namespace weft
