#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "weft/estimate/problem.h"

namespace weft {

/// While starts are tried: called after each simulation, from one thread at a time. Returning false
/// stops the search.
using StartObserver = std::function<bool()>;

/// The trial with the start that suits the fabric. What the camera does not see of the first frame
/// (where a rim hangs behind the cloth, or how a fold goes on inside) leaves several surfaces, of
/// which prepare_trial() keeps those that a generic sheet likes: Trial::other_starts. Each of them
/// is refined with this fabric in place of the generic one (refine_surfaces) and settled. From the
/// settled shape that looks most like the first compared frame ways out are tried again, then from
/// the next best, until that lowers the error of that frame by less than 3 %. The best three that
/// hang differently, from the trial's own start, too, are moved, and the one of the smallest error
/// over the first `frame_count` compared frames (0: all) is taken, never beyond the capture's fit
/// frames. The trial's own start stays where that does not lower its error by a tenth.
///
/// Returns `trial` itself where there is nothing to choose from or nothing better was found, or the
/// observer stopped it. Reads the video's first frame. Pure, whatever `threads` (0: all cores).
std::shared_ptr<const Trial> with_start_for(std::shared_ptr<const Trial> trial,
                                            const Fabric& fabric, int frame_count = 0,
                                            int threads = 0, const StartObserver& observer = {});

/// Of each.
std::vector<std::shared_ptr<const Trial>> with_starts_for(
    std::vector<std::shared_ptr<const Trial>> trials, const Fabric& fabric, int frame_count = 0,
    int threads = 0, const StartObserver& observer = {});

/// Each that has other starts with the equilibrium of `fabric` that its start leads to in its
/// place, if there is one: fabrics like it settle from there in a quarter of the iterations, and
/// into the same folds. `threads`: 0: all cores.
std::vector<std::shared_ptr<const Trial>> with_settled_starts(
    std::vector<std::shared_ptr<const Trial>> trials, const Fabric& fabric, int threads = 0);

/// `trial` with another start; its own is lost, or becomes one of the others.
std::shared_ptr<const Trial> with_start(const Trial& trial, Points start);
std::shared_ptr<const Trial> with_start_beside_own(const Trial& trial, Points start);

/// `trial` with the start of `other`, of the same capture on the same mesh.
std::shared_ptr<const Trial> with_start_of(const Trial& other, std::shared_ptr<const Trial> trial);

}  // namespace weft
