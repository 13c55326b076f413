#include "textile_studies.h"
namespace weft::validation {
void study_knits(const StudyFolders&) {}
}  // namespace weft::validation
