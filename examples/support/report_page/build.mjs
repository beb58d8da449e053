// node build.mjs <node_modules> <report_template.cpp>: bundles src/ with its libraries into one HTML page and writes that as
// a C++ source. The page asks nothing of the network.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const [modules, target] = process.argv.slice(2).map((path) => resolve(path));
const source = join(dirname(fileURLToPath(import.meta.url)), 'src');
const { buildSync } = createRequire(join(modules, 'anchor.js'))('esbuild');

function bundle(file, format) {
  const { outputFiles } = buildSync({
    entryPoints: [join(source, file)],
    bundle: true,
    minify: true,
    write: false,
    format,
    target: ['es2022'],
    charset: 'ascii',
    legalComments: 'none',
    nodePaths: [modules],
    logLevel: 'error',
  });
  return outputFiles[0].text.trim();
}

function licence(name, file) {
  const { version } = JSON.parse(readFileSync(join(modules, name, 'package.json'), 'utf8'));
  return `${name} ${version}\n${readFileSync(join(modules, name, file), 'utf8').trim()}`;
}

const parts = {
  STYLE: bundle('page.css'),
  SCRIPT: bundle('main.js', 'iife'),
  LICENCES: [licence('uplot', 'LICENSE'), licence('three', 'LICENSE')].join('\n\n').replaceAll('--', '- -'),
};
const page = readFileSync(join(source, 'page.html'), 'utf8').replace(/@(STYLE|SCRIPT|LICENCES)@/g, (_, part) => parts[part]);

const delimiter = 'report_page';
if (page.includes(`)${delimiter}"`)) throw new Error(`the page contains the delimiter ${delimiter}`);
mkdirSync(dirname(target), { recursive: true });
writeFileSync(
  target,
  `// Generated from examples/support/report_page by its build.mjs.
#include "report_template.hpp"

std::string_view example::report_template() noexcept {
  using namespace std::literals;
  return R"${delimiter}(${page})${delimiter}"sv;
}
`,
);
