#include "weft/base/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>

#include "common/temporary_folder.h"

namespace weft::files_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class Files : public ::testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(file_) << "text";
    fs::create_symlink("loop", loop_);
  }
  static std::string refusal(const std::function<void()>& call) {
    try {
      call();
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing thrown";
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path(), file_ = folder_ / "file", loop_ = folder_ / "loop",
           none_ = folder_ / "none", long_ = folder_ / std::string(300, 'a');
};

TEST_F(Files, TellsWhatIsThere) {
  EXPECT_TRUE(path_exists(file_) && path_exists(folder_));
  EXPECT_FALSE(path_exists(none_));
  EXPECT_FALSE(path_exists(file_ / "below"));
  EXPECT_TRUE(is_file(file_));
  EXPECT_FALSE(is_file(folder_) || is_file(none_));
  EXPECT_TRUE(is_folder(folder_));
  EXPECT_FALSE(is_folder(file_) || is_folder(none_));
}

TEST_F(Files, WhatCannotBeToldIsAnError) {
  const std::string circle = ": cannot be read: Too many levels of symbolic links";
  EXPECT_EQ(refusal([&] { path_exists(loop_); }), loop_.string() + circle);
  EXPECT_EQ(refusal([&] { is_folder(loop_); }), loop_.string() + circle);
  EXPECT_EQ(refusal([&] {
              is_file(loop_, {"capture.toml", 3, "motion"});
            }),
            "capture.toml:3: motion: " + loop_.string() + circle);
  EXPECT_EQ(refusal([&] { is_file(long_); }),
            long_.string() + ": cannot be read: File name too long");
}

TEST_F(Files, ListsAFolder) {
  auto entries = entries_of(folder_);
  std::ranges::sort(entries);
  EXPECT_THAT(entries, ElementsAre(file_, loop_));
  EXPECT_THAT(refusal([&] { entries_of(none_); }),
              StartsWith(none_.string() + ": cannot be read: "));
  EXPECT_THAT(refusal([&] { entries_of(loop_); }), HasSubstr("Too many levels"));
}

TEST_F(Files, RemovesAFile) {
  remove_file(file_);
  EXPECT_FALSE(path_exists(file_));
  remove_file(none_);
  fs::create_directories(folder_ / "full/inner");
  EXPECT_THAT(refusal([&] { remove_file(folder_ / "full"); }),
              StartsWith((folder_ / "full").string() + ": cannot be removed: "));
}

}  // namespace
}  // namespace weft::files_test
