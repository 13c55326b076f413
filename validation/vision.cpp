/// How exactly the angle map finds the direction of gratings.
///
///     weft_validate_vision [--contrast C] [--noise N] [--period PX]
///
/// C: (brightest - darkest) / full scale; N: standard deviation of the noise, of full scale; PX:
/// period. Without options the rows of docs/results.md. Sines and squares, nine directions all
/// around; prints the rms of the angle over the pixels where it is defined, and their share.
#include <fmt/format.h>

#include <cmath>
#include <string>
#include <vector>

#include "program.h"
#include "vision/gratings.h"
#include "weft/base/error.h"
#include "weft/vision/angle_map.h"

namespace weft::validation {
namespace {

constexpr int kSize = 112, kBorder = 34;  // px; the filters and their blur reach over the border

void print_error(testing::Grating grating) {
  AngleMapper mapper(kSize, kSize);
  double squares = 0, defined = 0, looked = 0;
  for (int k = 0; k < 9; ++k) {
    grating.angle = (-88 + 20.3 * k) * kDegree;
    grating.phase = 0.37 * k;
    const Image image =
        testing::make_grating(kSize, kSize, grating, static_cast<std::uint64_t>(k + 1));
    const AngleMap& map = mapper.compute(image, Mask(0, 0));
    for (int y = kBorder; y < kSize - kBorder; ++y)
      for (int x = kBorder; x < kSize - kBorder; ++x) {
        ++looked;
        if (map.valid(y, x) == 0) continue;
        const float e = orientation_difference(map.angle(y, x), static_cast<float>(grating.angle));
        squares += static_cast<double>(e) * static_cast<double>(e);
        ++defined;
      }
  }
  fmt::print(
      "{:<6} contrast {:<4g} noise {:<6g} period {:>4g} px: {:.3f} degrees rms, {:.1f} % defined\n",
      grating.square ? "square" : "sine", grating.contrast, grating.noise, grating.period,
      std::sqrt(squares / defined) / kDegree, 100 * defined / looked);
}

void run(int argc, char** argv) {
  testing::Grating asked;
  for (int i = 1; i < argc; i += 2) {
    const std::string option = argv[i];
    const bool value = i + 1 < argc;
    if (option == "--contrast" && value)
      asked.contrast = number<double>(option, argv[i + 1], 0.0);
    else if (option == "--noise" && value)
      asked.noise = number<double>(option, argv[i + 1], 0.0);
    else if (option == "--period" && value)
      asked.period = number<double>(option, argv[i + 1], 2.0);
    else
      throw Error("usage: weft_validate_vision [--contrast C] [--noise N] [--period PX]");
  }
  std::vector<testing::Grating> gratings{asked};
  if (argc == 1) {
    gratings.clear();
    for (const double period : {10.0, 17.0, 25.0})
      for (const double contrast : {1.0, 0.2})
        gratings.push_back({.period = period, .contrast = contrast, .noise = contrast / 50});
    for (const double contrast : {1.0, 0.2})
      gratings.push_back({.period = 17, .contrast = contrast, .noise = 0.05});
  }
  for (testing::Grating& grating : gratings)
    for (const bool square : {false, true}) {
      grating.square = square;
      print_error(grating);
    }
}

}  // namespace
}  // namespace weft::validation

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_vision", [&] {
    weft::validation::run(argc, argv);
    return 0;
  });
}
