#include "command_line.h"

#include <fmt/chrono.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace weft::app {
namespace {

std::string shell_quoted(const std::string& word) {
  constexpr const char* plain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,+";
  if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) return word;
  std::string result = "'";
  for (char c : word) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

}  // namespace

std::string command_line() {
  // Linux keeps the arguments here, each ended by a zero byte; no global of our own is needed.
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  const std::string raw((std::istreambuf_iterator<char>(file)), {});
  std::string line;
  std::size_t begin = 0;
  bool first = true;
  while (begin < raw.size()) {
    const std::size_t end = std::min(raw.find('\0', begin), raw.size());
    std::string word = raw.substr(begin, end - begin);
    if (first) word = std::filesystem::path(word).filename().string();
    line += (first ? "" : " ") + shell_quoted(word);
    first = false;
    begin = end + 1;
  }
  return line;
}

std::string now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%S%z}", fmt::localtime(std::time(nullptr)));
}

}  // namespace weft::app
