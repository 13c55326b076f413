#pragma once

namespace weft {

enum class HessianKind {
  exact,                 ///< indefinite under compression; what sensitivities need
  positive_semidefinite  ///< projected element by element; what Newton's direction needs
};

}  // namespace weft
