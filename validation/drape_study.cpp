#include "textile_studies.h"
namespace weft::validation {
void study_cusick(const StudyFolders&) {}
}  // namespace weft::validation
