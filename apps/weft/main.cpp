/// weft: estimates the parameters of a cloth simulator from measurements of a real fabric.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "commands.h"
#include "weft/base/error.h"
#include "weft/base/utf8.h"

CLI::App* weft::app::add_command(CLI::App& app, std::string name, std::string description) {
  return app.add_subcommand(std::move(name), std::move(description));
}

namespace {

constexpr int kUserError = 2;
constexpr int kInternalError = 1;

/// The message as one line: a user error is one line on the terminal and in a log.
std::string one_line(std::string text) {
  for (char& c : text) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

void add_subcommands(CLI::App& app) {
  using namespace weft::app;
  for (auto add :
       {add_check, add_surface, add_register, add_fit, add_evaluate, add_compare, add_matrix,
        add_landscape, add_variability, add_profile, add_suggest, add_posterior, add_simulate,
        add_render, add_synthesize, add_fabrics, add_export, add_cantilever, add_cusick}) {
    add(app);
  }
}

/// Arguments become text of JSON and TOML files, which would be refused after hours of computing.
void check_utf8(int argc, char** argv) {
  for (int i = 1; i < argc; ++i)
    if (!weft::is_utf8(argv[i]))
      throw weft::Error(
          fmt::format("argument {}, \"{}\", is not valid UTF-8", i, weft::utf8_escaped(argv[i])));
}

/// CLI11 says of a misspelled command only that one is required.
void check_command(const CLI::App& app, int argc, char** argv) {
  const std::string word = argc > 1 ? argv[1] : "";
  if (word.empty() || word.starts_with('-')) return;
  std::string known;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->check_name(word)) return;
    known += (known.empty() ? "" : ", ") + command->get_name();
  }
  throw weft::Error("\"" + word + "\" is no command; commands: " + known);
}

int run(int argc, char** argv) {
  CLI::App app(
      "weft estimates the parameters of a cloth simulator from measurements of a fabric: video of "
      "a swatch under projected stripes, forces and shapes of mechanical tests, 3D scans");
  app.set_version_flag("--version", WEFT_VERSION);
  app.require_subcommand(1);
  app.footer("weft COMMAND --help shows the arguments of a command and an example.");
  try {
    check_utf8(argc, argv);
    add_subcommands(app);
    check_command(app, argc, argv);
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {
    return app.exit(success);
  } catch (const CLI::RuntimeError& status) {
    return status.get_exit_code();
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "weft: error: %s\n", one_line(error.what()).c_str());
    return kUserError;
  } catch (const weft::Error& error) {
    std::fprintf(stderr, "weft: error: %s\n", one_line(error.what()).c_str());
    return kUserError;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "weft: internal error: %s\n", one_line(error.what()).c_str());
    return kInternalError;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    // Of a video that cannot be read the program says so itself, in one line.
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
    return run(argc, argv);
  } catch (...) {
    std::fputs("weft: internal error\n", stderr);
    return kInternalError;
  }
}
