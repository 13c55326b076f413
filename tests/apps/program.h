#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "apps/child_process.h"
#include "common/temporary_folder.h"

namespace weft {

/// What a run of the program left.
struct Outcome {
  int status = 0;
  std::string out, err;
};

inline std::string text_of(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// A folder of its own for each test, removed afterwards, that holds the program's cache too.
class ProgramTest : public testing::Test {
 protected:
  void SetUp() override { setenv("XDG_CACHE_HOME", (folder_ / "cache").c_str(), 1); }

  static std::vector<std::string> command(const std::vector<std::string>& arguments) {
    std::vector<std::string> words{WEFT_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return words;
  }
  static Outcome weft(const std::vector<std::string>& arguments) {
    ChildProcess child(command(arguments));
    child.wait();
    return {child.status(), child.out(), child.err()};
  }
  /// The reason why the program refused `arguments`: what follows "weft: error: ". The test fails
  /// if it did not end with status 2, or said anything but that one line.
  static std::string refusal(const std::vector<std::string>& arguments) {
    std::string line;
    for (const std::string& word : arguments) line += word + " ";
    const testing::ScopedTrace trace(__FILE__, __LINE__, line);
    const Outcome outcome = weft(arguments);
    EXPECT_EQ(outcome.status, 2) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    const std::string prefix = "weft: error: ";
    EXPECT_TRUE(outcome.err.starts_with(prefix)) << outcome.err;
    if (!outcome.err.starts_with(prefix)) return outcome.err;
    return outcome.err.substr(prefix.size(), outcome.err.size() - prefix.size() - 1);
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  /// Replaces the first `before` in a file of the folder; the test fails if there is none.
  void replace(const std::string& name, const std::string& before, const std::string& after) const {
    std::string text = text_of(folder_ / name);
    const std::size_t at = text.find(before);
    ASSERT_NE(at, std::string::npos) << "no \"" << before << "\" in " << name;
    write(name, text.replace(at, before.size(), after));
  }

  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

}  // namespace weft
