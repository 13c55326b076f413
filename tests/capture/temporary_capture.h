#pragma once
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/capture/capture.h"

namespace weft {

inline std::filesystem::path bundled_capture() {
  return std::filesystem::path(WEFT_SOURCE_DIR) / "data/captures/cotton_waving_A";
}

/// A folder of its own for each test, removed afterwards. It starts as a copy of the bundled
/// capture with an empty file for the video, which read_capture does not open.
class TemporaryCapture : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"capture.toml", "corners.csv"}) {
      write(name, text_of(bundled_capture() / name));
    }
    write("video.mp4", "");
  }

  static std::string text_of(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  /// Replaces the first `before` in a file of the folder; the test fails if there is none.
  void replace(const std::string& name, const std::string& before, const std::string& after) const {
    std::string text = text_of(folder_ / name);
    const std::size_t at = text.find(before);
    ASSERT_NE(at, std::string::npos) << "no \"" << before << "\" in " << name;
    write(name, text.replace(at, before.size(), after));
  }
  /// What read_capture says, without the folder's name in front.
  std::string message() const {
    return message_of([this] { read_capture(folder_); });
  }
  template <typename Function>
  std::string message_of(Function function) const {
    try {
      function();
    } catch (const Error& error) {
      std::string text = error.what();
      const std::string prefix = folder_.string() + "/";
      return text.starts_with(prefix) ? text.substr(prefix.size()) : text;
    }
    return "no error";
  }
  /// What read_capture says after one replacement in capture.toml, which is undone afterwards.
  std::string message_with(const std::string& before, const std::string& after) const {
    const std::string original = text_of(folder_ / "capture.toml");
    replace("capture.toml", before, after);
    std::string result = message();
    write("capture.toml", original);
    return result;
  }

  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

}  // namespace weft
