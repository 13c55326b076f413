#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// A fabric that a run has evaluated on all frames.
struct StoredPoint {
  VecX values;       ///< of the parameters asked for, SI
  double error = 0;  ///< finite
};
/// Reads evaluations.sqlite (docs/formats.md): all evaluations of the problem with this fingerprint
/// over all frames that did not diverge, in the order of writing, with the values of `parameters`,
/// of fabrics whose other values are those of `fixed` (to 1e-6 of them): a fit that went on with
/// another value of what it holds has evaluations that say nothing of this one.
/// A fit evaluates one problem for each start of the motion that it tries. Throws Error for a file
/// that is not there or is not such a store.
std::vector<StoredPoint> read_evaluations(const std::filesystem::path& path,
                                          const std::string& fingerprint,
                                          const std::vector<std::string>& parameters,
                                          const std::map<std::string, double>& fixed = {});

}  // namespace weft
