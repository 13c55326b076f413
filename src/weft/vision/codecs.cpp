#include "weft/vision/codecs.h"

#include <dlfcn.h>

#include "weft/base/error.h"

namespace weft {

const Codecs& codecs() {
  // Once loaded it stays: what OpenCV brings cannot all be unloaded.
  void* library = dlopen("libweft_codecs.so", RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  void* entry = library ? dlsym(library, "weft_codecs") : nullptr;
  if (!entry)
    throw Error(std::string("pictures and videos cannot be read or written: ") + dlerror());
  return *reinterpret_cast<const Codecs* (*)()>(entry)();
}

}  // namespace weft
