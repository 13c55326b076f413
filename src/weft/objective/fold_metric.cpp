#include "weft/objective/fold_metric.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

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

/// Pixels that are looked at together; a sum of a byte of each is kept in as many bytes.
constexpr Eigen::Index kChunk = 64;

/// Sums of zeros and ones, in a byte for each place of a chunk.
class Counter {
 public:
  void add(const std::uint8_t* ones) {
    for (Eigen::Index k = 0; k < kChunk; ++k) sums_[std::size_t(k)] += ones[k];
    if (++chunks_ == 255) flush();
  }
  std::int32_t total() {
    flush();
    return total_;
  }

 private:
  void flush() {
    for (std::uint8_t& sum : sums_) total_ += std::exchange(sum, std::uint8_t{0});
    chunks_ = 0;
  }
  std::array<std::uint8_t, kChunk> sums_{};
  int chunks_ = 0;
  std::int32_t total_ = 0;
};

/// A row of the two frames.
struct Row {
  const float *measured, *simulated;
  const std::uint8_t *mask, *measured_valid, *simulated_valid, *measured_inside, *simulated_inside;
};

/// Both angles lie in (-pi/2, pi/2], so that one half turn brings their difference into that
/// interval; its square is all that counts, so the end of the interval does not matter.
void add_folds(const Row& row, Eigen::Index first, const std::array<std::uint8_t, kChunk>& both,
               Eigen::Index count, std::array<float, 8>& fold) {
  constexpr float half_turn = std::numbers::pi_v<float>;
  const auto add = [&](Eigen::Index i, std::size_t part) {
    const float d = std::abs(row.measured[first + i] - row.simulated[first + i]);
    const float wrapped = std::min(d, std::abs(half_turn - d));
    fold[part] += float(both[std::size_t(i)]) * wrapped * wrapped;
  };
  Eigen::Index i = 0;
  for (; i + 8 <= count; i += 8)
    for (std::size_t k = 0; k < 8; ++k) add(i + Eigen::Index(k), k);
  for (; i < count; ++i) add(i, 0);
}

class Comparison {
 public:
  void add_row(const Row& row, Eigen::Index count) {
    std::array<float, 8> fold{};
    for (Eigen::Index first = 0; first < count; first += kChunk)
      add_chunk(row, first, std::min(kChunk, count - first), fold);
    float sum = 0;
    for (const float part : fold) sum += part;
    fold_ += double(sum);
  }
  FrameError error() {
    FrameError error;
    error.fold = fold_;
    error.silhouette = silhouette_.total();
    error.mask_pixels = masked_.total();
    error.overlap_pixels = overlap_.total();
    return error;
  }

 private:
  void add_chunk(const Row& row, Eigen::Index first, Eigen::Index count,
                 std::array<float, 8>& fold) {
    std::array<std::uint8_t, kChunk> differ{}, masked{}, both{};
    const auto look = [&](Eigen::Index size) {
      for (Eigen::Index i = 0; i < size; ++i) {
        const auto k = std::size_t(i);
        differ[k] = std::uint8_t(row.measured_inside[first + i] ^ row.simulated_inside[first + i]);
        masked[k] = row.mask[first + i];
        both[k] = std::uint8_t(row.mask[first + i] & row.measured_valid[first + i] &
                               row.simulated_valid[first + i]);
      }
    };
    // A constant size, as nearly all have, needs no loop.
    if (count == kChunk)
      look(kChunk);
    else
      look(count);
    silhouette_.add(differ.data());
    masked_.add(masked.data());
    overlap_.add(both.data());
    std::uint8_t any = 0;
    for (const std::uint8_t one : both) any |= one;
    if (any) add_folds(row, first, both, count, fold);
  }

  double fold_ = 0;
  Counter silhouette_, masked_, overlap_;
};

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

  Comparison comparison;
  const Eigen::Index columns = reference.cols();
  for (Eigen::Index y = 0; y < reference.rows(); ++y) {
    const Eigen::Index at = y * columns;
    comparison.add_row(
        {reference.data() + at, simulated.angle.data() + at, measured.fold_mask.data() + at,
         measured.angles.valid.data() + at, simulated.valid.data() + at,
         measured.silhouette.data() + at, simulated_silhouette.data() + at},
        columns);
  }
  return comparison.error();
}

}  // namespace weft
