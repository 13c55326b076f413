#include "weft/objective/fold_metric.h"

#include <numbers>
#include <string>

#include "weft/base/error.h"

namespace weft {
namespace {

void require_size(Eigen::Index rows, Eigen::Index columns, const Image& reference,
                  const char* what) {
  if (rows != reference.rows() || columns != reference.cols())
    throw Error("fold metric: " + std::string(what) + " is " + std::to_string(columns) + " x " +
                std::to_string(rows) + " px, the measured frame " +
                std::to_string(reference.cols()) + " x " + std::to_string(reference.rows()));
}

struct RowSums {
  float fold = 0;
  std::int32_t silhouette = 0, masked = 0, overlap = 0;
};

/// Sums over one row. Both angles lie in (-pi/2, pi/2], so that one half turn brings their
/// difference into that interval; its square is all that counts, so the end of the interval does
/// not matter.
RowSums compare_row(const float* measured, const float* simulated, const std::uint8_t* mask,
                    const std::uint8_t* measured_valid, const std::uint8_t* simulated_valid,
                    const std::uint8_t* measured_inside, const std::uint8_t* simulated_inside,
                    Eigen::Index count) {
  constexpr float half_turn = std::numbers::pi_v<float>;
  RowSums sums;
  std::int32_t silhouette = 0, masked = 0, overlap = 0;
  float fold[8] = {};
  Eigen::Index x = 0;
  const auto term = [&](Eigen::Index i) {
    const float d = std::abs(measured[i] - simulated[i]);
    const float wrapped = std::min(d, std::abs(half_turn - d));
    const int both = mask[i] & measured_valid[i] & simulated_valid[i];
    return float(both) * wrapped * wrapped;
  };
  for (; x + 8 <= count; x += 8)
    for (int k = 0; k < 8; ++k) fold[k] += term(x + k);
  for (; x < count; ++x) fold[0] += term(x);
  for (Eigen::Index i = 0; i < count; ++i) {
    silhouette += measured_inside[i] ^ simulated_inside[i];
    masked += mask[i];
    overlap += mask[i] & measured_valid[i] & simulated_valid[i];
  }
  for (const float part : fold) sums.fold += part;
  sums.silhouette = silhouette;
  sums.masked = masked;
  sums.overlap = overlap;
  return sums;
}

}  // namespace

FrameError compare(const FrameFeatures& measured, const AngleMap& simulated,
                   const Mask& simulated_silhouette) {
  const Image& reference = measured.angles.angle;
  const auto same = [&](const auto& plane, const char* what) {
    require_size(plane.rows(), plane.cols(), reference, what);
  };
  same(measured.angles.valid, "the measured angles' validity");
  same(measured.fold_mask, "the fold mask");
  same(measured.silhouette, "the measured silhouette");
  same(simulated.angle, "the simulated angle map");
  same(simulated.valid, "the simulated angles' validity");
  same(simulated_silhouette, "the simulated silhouette");

  FrameError error;
  const Eigen::Index columns = reference.cols();
  for (Eigen::Index y = 0; y < reference.rows(); ++y) {
    const Eigen::Index at = y * columns;
    const RowSums sums = compare_row(
        reference.data() + at, simulated.angle.data() + at, measured.fold_mask.data() + at,
        measured.angles.valid.data() + at, simulated.valid.data() + at,
        measured.silhouette.data() + at, simulated_silhouette.data() + at, columns);
    error.fold += double(sums.fold);
    error.silhouette += sums.silhouette;
    error.mask_pixels += sums.masked;
    error.overlap_pixels += sums.overlap;
  }
  return error;
}

}  // namespace weft
