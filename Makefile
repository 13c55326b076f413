# The jobs of the project. `make help` lists them.
.PHONY: help setup build install test check demo bench validate format clean

PREFIX ?= /usr/local

help:        ## this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/'
setup:       ## install the Debian packages that the project builds with
	@scripts/setup
build: setup ## the program at build/weft
	@scripts/build release
install: build ## the program and its libraries to PREFIX, /usr/local if not set
	@cmake --install build --prefix "$(PREFIX)"
test: build  ## the release build and its tests
	@ctest --test-dir build --output-on-failure --no-tests=error -j2
check:       ## sanitizers, formatting, lint
	@scripts/setup check
	@scripts/check
demo: build  ## fit the bundled capture and say where the report is
	@scripts/demo
bench: setup ## benchmarks
	@scripts/bench
validate: build ## longer validations: make validate DATA=folder-of-captures
	@scripts/validate "$(DATA)"
format:      ## format the sources in place
	@git ls-files '*.h' '*.cpp' | xargs clang-format -i
clean:
	@rm -rf build build-*
