#pragma once
/// The subcommands of the program: one file each, one function that declares its arguments and what
/// it does. main.cpp holds the table, and alone includes all of CLI11, which is in headers and
/// takes a compiler seconds.
#include <CLI/App.hpp>
#include <string>

namespace weft::app {

/// A subcommand of `app`.
CLI::App* add_command(CLI::App& app, std::string name, std::string description);

void add_check(CLI::App& app);
void add_surface(CLI::App& app);
void add_register(CLI::App& app);
void add_fit(CLI::App& app);
void add_simulate(CLI::App& app);
void add_render(CLI::App& app);
void add_evaluate(CLI::App& app);
void add_compare(CLI::App& app);
void add_landscape(CLI::App& app);
void add_variability(CLI::App& app);
void add_matrix(CLI::App& app);
void add_fabrics(CLI::App& app);
void add_synthesize(CLI::App& app);
void add_suggest(CLI::App& app);
void add_posterior(CLI::App& app);
void add_profile(CLI::App& app);
void add_cantilever(CLI::App& app);
void add_cusick(CLI::App& app);
void add_export(CLI::App& app);

}  // namespace weft::app
