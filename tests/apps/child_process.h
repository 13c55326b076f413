#pragma once
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace weft {

/// A program started with its output and its messages on pipes.
class ChildProcess {
 public:
  explicit ChildProcess(const std::vector<std::string>& command) {
    int out[2], err[2];
    if (pipe2(out, O_CLOEXEC) != 0 || pipe2(err, O_CLOEXEC) != 0)
      throw std::runtime_error("no pipe");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, err[1], STDERR_FILENO);
    std::vector<char*> arguments;
    for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const int failure =
        posix_spawn(&pid_, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(out[1]);
    close(err[1]);
    streams_[0].fd = out[0];
    streams_[1].fd = err[0];
    if (failure != 0) throw std::runtime_error(command[0] + ": " + std::strerror(failure));
  }
  ~ChildProcess() {
    if (!ended_) {
      send(SIGKILL);
      wait();
    }
    for (const Stream& stream : streams_) close(stream.fd);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Waits until the program has said `text` on stderr; false if it ended without.
  bool wait_for(const std::string& text) {
    while (streams_[1].text.find(text) == std::string::npos) {
      if (!read_some()) return false;
    }
    return true;
  }
  void send(int signal) const { kill(pid_, signal); }
  /// Reads until the program has closed both pipes, and collects its status.
  void wait() {
    while (read_some()) {
    }
    if (!ended_) waitpid(pid_, &status_, 0);
    ended_ = true;
  }
  /// After wait(): the exit status; minus the signal that ended it.
  int status() const { return WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_); }
  const std::string& out() const { return streams_[0].text; }
  const std::string& err() const { return streams_[1].text; }

 private:
  struct Stream {
    int fd = -1;
    bool open = true;
    std::string text;
  };

  /// Blocks until there is something to read; false when both pipes are closed.
  bool read_some() {
    pollfd polled[2];
    for (int i = 0; i < 2; ++i) polled[i] = {streams_[i].open ? streams_[i].fd : -1, POLLIN, 0};
    if (!streams_[0].open && !streams_[1].open) return false;
    while (poll(polled, 2, -1) < 0) {
      if (errno != EINTR) throw std::runtime_error("poll failed");
    }
    for (int i = 0; i < 2; ++i) {
      if (polled[i].revents == 0) continue;
      char buffer[4096];
      const ssize_t count = read(streams_[i].fd, buffer, sizeof buffer);
      if (count > 0)
        streams_[i].text.append(buffer, static_cast<std::size_t>(count));
      else
        streams_[i].open = false;
    }
    return true;
  }

  pid_t pid_ = 0;
  int status_ = 0;
  bool ended_ = false;
  Stream streams_[2];
};

}  // namespace weft
