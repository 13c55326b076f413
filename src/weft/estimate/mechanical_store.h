#pragma once
/// What a fit to mechanical captures keeps, so that it continues after it was killed.
#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "weft/estimate/mechanical_trial.h"
#include "weft/estimate/number_store.h"

namespace weft {

/// The numbers of each evaluation, and the equilibria that evaluations to come may start from.
///
/// An equilibrium is known to a tolerance only, so what is found depends in its last digits on
/// where it was started: a continued fit ends at the same numbers as one that was left alone only
/// if it goes on from the same shapes. They are large, some megabytes an evaluation, but those of a
/// chain before its newest linearization are of no use any more and are removed.
///
/// Safe to use from several threads.
class MechanicalStore {
 public:
  /// Opens or creates. `fit`: a hash of all that decides the fit. Throws Error as NumberStore does.
  MechanicalStore(const std::filesystem::path& path, std::string_view fit);

  /// Numbers of an evaluation, by a hash of what was asked for.
  std::optional<VecX> find(std::string_view evaluation) const;
  void add(std::string_view evaluation, const VecX& numbers);
  /// Evaluations that find() has found since the store was opened.
  std::size_t replayed() const { return replayed_; }

  /// To be added before the evaluation's numbers. `chain`: a word.
  void add_shapes(std::string_view chain, std::string_view evaluation,
                  const MechanicalFrames& frames);
  /// Number and shape of each frame, of an equilibrium, nothing else. Throws Error if they are not
  /// there.
  MechanicalFrames shapes(std::string_view chain, std::string_view evaluation,
                          const std::vector<std::shared_ptr<const MechanicalTrial>>& trials) const;
  void remove_shapes_but(std::string_view chain, std::string_view evaluation);

 private:
  std::string path_;
  NumberStore numbers_;
  mutable std::atomic<std::size_t> replayed_ = 0;
};

}  // namespace weft
