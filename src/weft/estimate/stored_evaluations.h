#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// A fabric that a run has evaluated on all frames.
struct StoredPoint {
  VecX values;       ///< of the parameters asked for, SI
  double error = 0;  ///< finite
};
/// Reads evaluations.sqlite (docs/formats.md): all evaluations over all frames that did not
/// diverge, in the order of writing, with the values of `parameters`. Throws Error for a file that
/// is not there, is not such a store, or holds evaluations of several problems.
std::vector<StoredPoint> read_evaluations(const std::filesystem::path& path,
                                          const std::vector<std::string>& parameters);

}  // namespace weft
