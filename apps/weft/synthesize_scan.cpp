#include "synthesize_scan.h"

#include <fmt/core.h>

namespace weft::app {

const std::vector<std::string>& SynthesizeScanArguments::names() {
  static const std::vector<std::string> names{
      "--experiments", "--swatch", "--registered-cells", "--refinement", "--noise",
      "--force-noise", "--clouds", "--points",           "--outliers",   "--hole"};
  return names;
}

void SynthesizeScanArguments::add_to(CLI::App& command) {
  command.add_flag("--scan", wanted_,
                   "scans of a swatch at rest, with forces, instead of a video: OUT is one capture "
                   "with a target for each of --experiments");
  command
      .add_option("--experiments", experiments_,
                  "with --scan: frame:DEGREES (picture frame, -60 to 60), stretch-u:STRAIN and "
                  "stretch-v (0 to 0.5), corners:LEFT,RIGHT[,SEPARATION] (hung by two corners 0.2 "
                  "to 1 times as far apart as on the fabric, default 0.95; weights of 0 to 10 kg "
                  "on the others), edge-u:WEIGHT and edge-v (hung by an edge, 0 to 10 kg on the "
                  "other), ledge-u:SUPPORT and ledge-v (on a table up to SUPPORT, m)")
      ->capture_default_str();
  command.add_option("--swatch", swatch_, "with --scan: WIDTHxHEIGHT along u and v, m, 0.01 to 10")
      ->capture_default_str();
  command
      .add_option("--registered-cells", options_.registered_cells,
                  "with --scan: cells of the grid that is written, across the shorter side; "
                  "borders of clamps lie on its lines")
      ->check(integer_in(2, 200))
      ->capture_default_str();
  command
      .add_option("--refinement", options_.refinement,
                  "with --scan: cells of the truth's mesh along a side of each of these")
      ->check(integer_in(1, 16))
      ->capture_default_str();
  command
      .add_option("--noise", options_.noise,
                  "with --scan: standard deviation of a coordinate, m, 0 to 0.1")
      ->check(number_in(0, 0.1))
      ->capture_default_str();
  command
      .add_option("--force-noise", options_.force_noise,
                  "with --scan: standard deviation of a clamp's force, N, 0 to 1000")
      ->check(number_in(0, 1e3))
      ->capture_default_str();
  command.add_flag("--clouds", clouds_,
                   "with --scan: clouds of points, with the clamps as landmarks, instead of grids");
  command.add_option("--points", options_.cloud.points, "with --clouds: of a cloud")
      ->check(integer_in(100, 10'000'000))
      ->capture_default_str();
  command
      .add_option("--outliers", options_.cloud.outliers,
                  "with --clouds: share of the points that lie anywhere, 0 to 0.5")
      ->check(number_in(0, 0.5))
      ->capture_default_str();
  command
      .add_option("--hole", options_.cloud.hole,
                  "with --clouds: radius of a hole in each cloud, m, 0 to 10; 0: none")
      ->check(number_in(0, 10))
      ->capture_default_str();
}

void SynthesizeScanArguments::run(const Fabric& fabric, const std::string& out, bool with_noise,
                                  std::uint64_t seed, Existing existing) const {
  SyntheticScanOptions options = options_;
  const std::vector<double> sides = numbers_in("--swatch", swatch_, 'x', 2);
  options.width = sides[0];
  options.height = sides[1];
  options.areal_density = *fabric.areal_density;
  options.seed = seed;
  if (clouds_) options.form = SyntheticScanForm::clouds;
  if (!with_noise) options.noise = options.force_noise = 0;
  prepare_output_folder(out, {"capture.toml"}, existing);
  const ScanCapture made = make_synthetic_scans(out, fabric, experiments_, options);
  fmt::print("{}: {} {} of {}\n", made.folder.string(), made.targets.size(),
             clouds_ ? "clouds" : "registered scans", fabric.name);
}

}  // namespace weft::app
