#include <algorithm>
#include <array>
#include <cmath>

#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/capture/capture.h"
#include "weft/capture/srgb.h"

namespace weft {

void add_sensor_noise(Image& linear, const SensorNoise& noise, std::uint64_t seed, int frame) {
  if (!(noise.full_well > 0) || !(noise.read_noise >= 0)) {
    throw Error("sensor noise: full_well must be above 0, read_noise at least 0 electrons");
  }
  std::array<float, 256> decoded;
  for (std::size_t code = 0; code < decoded.size(); ++code) {
    decoded[code] = static_cast<float>(srgb_decode(static_cast<double>(code) / 255));
  }
  Rng rng(seed, static_cast<std::uint64_t>(frame));
  for (float& pixel : linear.reshaped<Eigen::RowMajor>()) {
    const double electrons = std::max(static_cast<double>(pixel), 0.0) * noise.full_well;
    // Shot noise as a normal of variance `electrons`: where they are so few that its skew would
    // show, read noise covers it.
    const double sigma = std::sqrt(electrons + noise.read_noise * noise.read_noise);
    const double measured = (electrons + sigma * rng.normal()) / noise.full_well;
    pixel = decoded[srgb_byte(measured)];
  }
}

}  // namespace weft
