#pragma once
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <type_traits>

#include "weft/estimate/mechanical_trial.h"
#include "weft/estimate/problem.h"

namespace weft {

/// A 64-bit hash of content, to tell accidental differences apart (not against an adversary). The
/// same on every machine of one byte order.
class ContentHash {
 public:
  void add_bytes(const void* data, std::size_t size);
  template <typename T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void add(T value) { add_bytes(&value, sizeof value); }
  void add(std::string_view text);
  /// Size and coefficients.
  template <typename Derived>
  void add(const Eigen::PlainObjectBase<Derived>& values) {
    add(values.rows());
    add(values.cols());
    add_bytes(values.data(),
              static_cast<std::size_t>(values.size()) * sizeof(typename Derived::Scalar));
  }
  std::uint64_t value() const { return state_; }
  /// 16 hexadecimal digits.
  std::string hex() const;

 private:
  std::uint64_t state_ = 0x9e3779b97f4a7c15u;
};

/// All that decides the error of a fabric on a trial.
void add_trial(ContentHash& hash, const Trial& trial);
/// All that decides the equilibria of a fabric in a mechanical capture, and their differences to
/// what was measured.
void add_trial(ContentHash& hash, const MechanicalTrial& trial);
/// The numbers of a fabric and what they mean: model, values, ranges, knots.
void add_fabric(ContentHash& hash, const Fabric& fabric);
/// All that decides a trial: the bytes of the video, the capture's values, frames and options.
/// Throws Error if the video cannot be read.
std::string preparation_key(const Capture& capture, int first, int last,
                            const TrialOptions& options);

}  // namespace weft
