#include "real_motion.h"
#include "weft/base/error.h"

namespace weft::validation {

void study_video(const std::filesystem::path&, const std::filesystem::path&, double, double) {
  throw Error("not there yet");
}

}  // namespace weft::validation
