#include "weft/estimate/mechanical_store.h"

#include <fmt/format.h>

#include "weft/base/error.h"
#include "weft/estimate/packed_numbers.h"

namespace weft {
namespace {

// Chains and keys of evaluations have no blanks.
std::string shapes_key(std::string_view chain, std::string_view evaluation) {
  return fmt::format("shapes {} {}", chain, evaluation);
}

}  // namespace

MechanicalStore::MechanicalStore(const std::filesystem::path& path, std::string_view fit)
    : path_(path.string()), numbers_(path, fit) {}

std::optional<VecX> MechanicalStore::find(std::string_view evaluation) const {
  std::optional<VecX> found = numbers_.find(evaluation);
  if (found) ++replayed_;
  return found;
}

void MechanicalStore::add(std::string_view evaluation, const VecX& numbers) {
  numbers_.add(evaluation, numbers);
}

void MechanicalStore::add_shapes(std::string_view chain, std::string_view evaluation,
                                 const MechanicalFrames& frames) {
  NumberWriter writer;
  for (const auto& trial : frames)
    for (const MechanicalFrame& frame : trial) writer.add(frame.x);
  numbers_.add(shapes_key(chain, evaluation), writer.numbers());
}

MechanicalFrames MechanicalStore::shapes(
    std::string_view chain, std::string_view evaluation,
    const std::vector<std::shared_ptr<const MechanicalTrial>>& trials) const {
  const std::optional<VecX> numbers = numbers_.find(shapes_key(chain, evaluation));
  if (!numbers)
    throw Error(
        fmt::format("{}: lacks the shapes that the fit was at; name another folder, or "
                    "give --overwrite",
                    path_));
  NumberReader reader(*numbers);
  MechanicalFrames frames;
  for (const auto& trial : trials) {
    auto& own = frames.emplace_back();
    for (int k = 0; k < trial->capture.frame_count; ++k) {
      const int stage = trial->stage_of_frame[static_cast<std::size_t>(k)];
      MechanicalFrame& frame = own.emplace_back();
      frame.frame = k;
      frame.converged = true;
      frame.x =
          reader.matrix(3, trial->stages[static_cast<std::size_t>(stage)].mesh.vertex_count());
    }
  }
  return frames;
}

void MechanicalStore::remove_shapes_but(std::string_view chain, std::string_view evaluation) {
  numbers_.remove_all_but(shapes_key(chain, ""), shapes_key(chain, evaluation));
}

}  // namespace weft
