#pragma once
/// The overhang of a strip that bends under its own weight (ASTM D1388 option A): a strip is pushed
/// over a horizontal edge until the line from the edge to the middle of its tip is at a stated
/// angle below the horizontal. How far it then overhangs is read, once or several times.
#include "weft/base/types.h"

namespace weft {

/// Of one test.
struct OverhangTest {
  VecX lengths;                       ///< m, > 0; readings, one a frame
  double angle = 0.7243116395776468;  ///< rad below the horizontal; 41.5 degrees
  double deviation = 1e-3;            ///< m, standard deviation of one reading, > 0

  double mean() const { return lengths.mean(); }
};

/// Standard deviation of a reading where none is stated, m: the scatter of three readings or more,
/// but no less than that of one to the nearest mm, 1 mm / sqrt(12); of fewer readings 1 mm.
double overhang_deviation(const VecX& lengths);

}  // namespace weft
