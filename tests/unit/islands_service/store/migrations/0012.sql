BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0012');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('2e764cf446bb4b8681e714c4c7d151da','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
CREATE TABLE audit (
	number INTEGER NOT NULL, 
	at FLOAT NOT NULL, 
	action VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	subject VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16), 
	address VARCHAR(64) NOT NULL, details TEXT, 
	CONSTRAINT pk_audit PRIMARY KEY (number)
);
INSERT INTO "audit" VALUES(1,1.79581392221998119348e+09,'cancel-job','alice','ebfce12dec7048afb656a91e9bb3cf21','0123456789abcdef','192.0.2.1',NULL);
INSERT INTO "audit" VALUES(2,1.79581392222501039506e+09,'delete-job','alice','ebfce12dec7048afb656a91e9bb3cf21',NULL,'command line',NULL);
CREATE TABLE datasets (
	owner VARCHAR(64) NOT NULL, 
	id VARCHAR(48) NOT NULL, 
	name VARCHAR(255) NOT NULL, 
	suffix VARCHAR(16) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	bytes BIGINT NOT NULL, 
	preview TEXT NOT NULL, 
	created FLOAT NOT NULL, summary TEXT, deleted FLOAT, source TEXT, idle_since FLOAT, 
	CONSTRAINT pk_datasets PRIMARY KEY (owner, id)
);
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79581392211899614329e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0, "reading": {}}',NULL,'https://example.org/a.csv',NULL);
CREATE TABLE deliveries (
	id VARCHAR(32) NOT NULL, 
	webhook_id VARCHAR(32) NOT NULL, 
	event VARCHAR(32) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	body TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	attempts INTEGER NOT NULL, 
	next_at FLOAT, 
	attempted FLOAT, 
	delivered FLOAT, 
	status INTEGER, 
	error TEXT, 
	CONSTRAINT pk_deliveries PRIMARY KEY (id), 
	CONSTRAINT fk_deliveries_webhook_id FOREIGN KEY(webhook_id) REFERENCES webhooks (id) ON DELETE CASCADE
);
INSERT INTO "deliveries" VALUES('c63dcc2433754208afe8cab44bf3b3c6','07bd0009bbc943078242f96106c9959e','job.succeeded','7dbd167ce6e04dc5a552dbf97a9448cf','{"type":"job.succeeded","timestamp":"2026-11-27T21:12:02.185+00:00","data":{"job":"7dbd167ce6e04dc5a552dbf97a9448cf","kind":"identification","name":"it''s done; really","state":"succeeded","links":{"job":"/v1/jobs/7dbd167ce6e04dc5a552dbf97a9448cf","result":"/v1/jobs/7dbd167ce6e04dc5a552dbf97a9448cf/result","report":"/v1/jobs/7dbd167ce6e04dc5a552dbf97a9448cf/report"}}}',1.79581392218501853944e+09,0,1.79581392218501853944e+09,NULL,NULL,NULL,NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('fc66d3cf24614f1ebc57e67584f75c29',1,'queued','{}',1.79581392213999772077e+09);
INSERT INTO "events" VALUES('fc66d3cf24614f1ebc57e67584f75c29',2,'cancelled','{}',1.79581392214699840552e+09);
INSERT INTO "events" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf',1,'queued','{}',1.79581392215798187257e+09);
INSERT INTO "events" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf',2,'running','{"attempt": 1}',1.79581392217399477958e+09);
INSERT INTO "events" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf',3,'progress','{"generation": 3}',1.79581392217801809308e+09);
INSERT INTO "events" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf',4,'succeeded','{"best": 0.5}',1.79581392218501853944e+09);
INSERT INTO "events" VALUES('2e764cf446bb4b8681e714c4c7d151da',1,'queued','{}',1.79581392219600224488e+09);
INSERT INTO "events" VALUES('2e764cf446bb4b8681e714c4c7d151da',2,'running','{"attempt": 1}',1.79581392219998550417e+09);
INSERT INTO "events" VALUES('2e764cf446bb4b8681e714c4c7d151da',3,'progress','{"generation": 3}',1.79581392220199704168e+09);
INSERT INTO "events" VALUES('2e764cf446bb4b8681e714c4c7d151da',4,'failed','{"type": "broken", "detail": "it broke"}',1.79581392220698595049e+09);
INSERT INTO "events" VALUES('1cdbe60de4f84f988383adcb3cffa00a',1,'queued','{}',1.79581392221201515194e+09);
INSERT INTO "events" VALUES('1cdbe60de4f84f988383adcb3cffa00a',2,'cancelled','{}',1.79581392221398639681e+09);
INSERT INTO "events" VALUES('7749448431ef476e85e4a6e737bec57d',1,'queued','{}',1.79581392222698187823e+09);
INSERT INTO "events" VALUES('7749448431ef476e85e4a6e737bec57d',2,'running','{"attempt": 1}',1.79581392223100519186e+09);
INSERT INTO "events" VALUES('7749448431ef476e85e4a6e737bec57d',3,'progress','{"generation": 5}',1.79581392223398232459e+09);
INSERT INTO "events" VALUES('ec39776fddc54b79bda66ad3a12447dd',1,'queued','{}',1795813922.237);
CREATE TABLE jobs (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	kind VARCHAR(32) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255), 
	priority INTEGER NOT NULL, 
	state VARCHAR(16) NOT NULL, 
	version BIGINT NOT NULL, 
	attempt INTEGER NOT NULL, 
	stalled INTEGER NOT NULL, 
	lease_owner VARCHAR(128), 
	lease_epoch BIGINT NOT NULL, 
	lease_until FLOAT NOT NULL, 
	cancel_requested BOOLEAN NOT NULL, 
	progress TEXT, 
	checkpoint VARCHAR(64), 
	summary TEXT, 
	problem TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	started FLOAT, 
	finished FLOAT, islands_version VARCHAR(64), checkpoint_version VARCHAR(64), result_version VARCHAR(64), not_before FLOAT DEFAULT 0 NOT NULL, declined TEXT DEFAULT '' NOT NULL, islands INTEGER DEFAULT 1 NOT NULL, monitor_id VARCHAR(32), record_number BIGINT, run_seconds FLOAT DEFAULT 0 NOT NULL, max_run_seconds BIGINT, tags TEXT DEFAULT '' NOT NULL, search_labels TEXT DEFAULT '' NOT NULL, search_result TEXT DEFAULT '' NOT NULL, dataset_name VARCHAR(255), model_error FLOAT, stop_requested BOOLEAN DEFAULT 0 NOT NULL, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('fc66d3cf24614f1ebc57e67584f75c29','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79581392213999772077e+09,1.79581392214699840552e+09,NULL,1.79581392214699840552e+09,'0.1.0',NULL,NULL,0.0,'',1,'a0aac4fdc26d423ebe4eba0c2add53df',1,0.0,NULL,'','
','',NULL,NULL,0);
INSERT INTO "jobs" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79581752217399477958e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.79581392215798187257e+09,1.79581392218501853944e+09,1.79581392217399477958e+09,1.79581392218501853944e+09,'0.1.0','0.1.0','0.1.0',0.0,'',1,NULL,NULL,0.0,NULL,'','it''s done; really
','',NULL,NULL,0);
INSERT INTO "jobs" VALUES('2e764cf446bb4b8681e714c4c7d151da','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79581752219998550413e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79581392219600224488e+09,1.79581392220698595049e+09,1.79581392219998550417e+09,1.79581392220698595049e+09,'0.1.0','0.1.0',NULL,0.0,'',1,NULL,NULL,0.0,NULL,'','it''s done; really
','',NULL,NULL,0);
INSERT INTO "jobs" VALUES('1cdbe60de4f84f988383adcb3cffa00a','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79581392221201515194e+09,1.79581392221398639681e+09,NULL,1.79581392221398639681e+09,'0.1.0',NULL,NULL,0.0,'',1,NULL,NULL,0.0,NULL,'','
','',NULL,NULL,0);
INSERT INTO "jobs" VALUES('7749448431ef476e85e4a6e737bec57d','alice','identification','','{"seed": 7}','a67a554034db15d7f73dda2a799c5c9614239099cea2418d61d6af96df538230',NULL,-7,'running',3,1,0,'b3bd0eea268549f896b488e39476f60b',1,1.79581392123100519182e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.79581392222698187823e+09,1.79581392223398232459e+09,1.79581392223100519186e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'',1,NULL,NULL,0.0,NULL,',rig 2,','
rig 2
','',NULL,NULL,0);
INSERT INTO "jobs" VALUES('ec39776fddc54b79bda66ad3a12447dd','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1795813922.237,1795813922.237,NULL,NULL,'0.1.0',NULL,NULL,0.0,'',1,NULL,NULL,0.0,NULL,'','
','',NULL,NULL,0);
CREATE TABLE keys (
	id VARCHAR(16) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	secret_sha256 VARCHAR(64) NOT NULL, 
	scopes TEXT NOT NULL, 
	created FLOAT NOT NULL, 
	expires FLOAT, 
	revoked FLOAT, 
	CONSTRAINT pk_keys PRIMARY KEY (id), 
	CONSTRAINT uq_keys_secret_sha256 UNIQUE (secret_sha256)
);
INSERT INTO "keys" VALUES('4f491f008d040566','alice','revoked','4d03e7f268bc4ad5c5cc7f3757e48b30b9478d6a67dab2bd791cdc98e4b04a69','["read", "write"]',1.79581392210901832581e+09,1.79581752210901832581e+09,1.79581392211501312261e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf',2,'{"fitness": 0.7}','second');
CREATE TABLE monitor_records (
	monitor_id VARCHAR(32) NOT NULL, 
	is_rejected BOOLEAN NOT NULL, 
	place BIGINT NOT NULL, 
	name TEXT NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	state TEXT NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_monitor_records PRIMARY KEY (monitor_id, is_rejected, place), 
	CONSTRAINT fk_monitor_records_monitor_id_monitors FOREIGN KEY(monitor_id) REFERENCES monitors (id) ON DELETE CASCADE
);
INSERT INTO "monitor_records" VALUES('a0aac4fdc26d423ebe4eba0c2add53df',0,0,'record 4','0000000000000000000000000000000000000000000000000000000000000004','4','{"index": 0, "name": "record 4", "sha256": "0000000000000000000000000000000000000000000000000000000000000004"}');
CREATE TABLE monitors (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	spec TEXT NOT NULL, 
	priority INTEGER NOT NULL, 
	version BIGINT NOT NULL, 
	submitted BIGINT NOT NULL, 
	status VARCHAR(16) NOT NULL, 
	records BIGINT NOT NULL, 
	alarms BIGINT NOT NULL, 
	state TEXT, 
	document TEXT, 
	created FLOAT NOT NULL, 
	updated FLOAT NOT NULL, 
	islands_version VARCHAR(64), start BIGINT DEFAULT 0 NOT NULL, last_alarm TEXT, 
	CONSTRAINT pk_monitors PRIMARY KEY (id)
);
INSERT INTO "monitors" VALUES('a0aac4fdc26d423ebe4eba0c2add53df','alice','press','{"input": "u"}',0,1,1,'normal',1,0,'{"schema": "islands.monitor-head/1", "state": {"records": []}, "rejected": []}','{"count": 1}',1.7958139221280083656e+09,1.7958139221519873142e+09,'0.1.0',0,NULL);
CREATE TABLE owners (
	name VARCHAR(64) NOT NULL, 
	weight INTEGER NOT NULL, 
	virtual_time BIGINT, 
	max_active BIGINT, 
	max_running BIGINT, 
	max_uploads BIGINT, 
	max_stored BIGINT, 
	max_streams BIGINT, 
	max_drawings BIGINT, dataset_retention BIGINT, max_islands BIGINT, max_run_seconds BIGINT, 
	CONSTRAINT pk_owners PRIMARY KEY (name)
);
INSERT INTO "owners" VALUES('alice',100,10000000,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "owners" VALUES('bob',100,0,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('2e764cf446bb4b8681e714c4c7d151da',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('7749448431ef476e85e4a6e737bec57d',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('7dbd167ce6e04dc5a552dbf97a9448cf','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','ebfce12dec7048afb656a91e9bb3cf21','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79581392221901559825e+09);
CREATE TABLE webhooks (
	id VARCHAR(32) NOT NULL, 
	owner VARCHAR(64) NOT NULL, 
	url TEXT NOT NULL, 
	events TEXT NOT NULL, 
	secret VARCHAR(64) NOT NULL, 
	created FLOAT NOT NULL, 
	busy_until FLOAT DEFAULT 0 NOT NULL, 
	CONSTRAINT pk_webhooks PRIMARY KEY (id)
);
INSERT INTO "webhooks" VALUES('07bd0009bbc943078242f96106c9959e','alice','https://hooks.example.org/a','["job.succeeded"]','whsec_tdGLFvUUHSqnaRq2iKP/e73U+fBmM1P6CWjDy6qSHwY=',1.79581392212398505215e+09,0.0);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
CREATE INDEX ix_owners_virtual_time ON owners (virtual_time);
CREATE INDEX ix_webhooks_owner ON webhooks (owner);
CREATE INDEX ix_deliveries_webhook_id_next_at ON deliveries (webhook_id, next_at);
CREATE INDEX ix_deliveries_webhook_id_created ON deliveries (webhook_id, created);
CREATE INDEX ix_jobs_queue ON jobs (state, owner, priority DESC, created, id, islands);
CREATE INDEX ix_monitors_owner_created_id ON monitors (owner, created, id);
CREATE INDEX ix_jobs_monitor ON jobs (monitor_id, state, record_number) WHERE monitor_id IS NOT NULL;
CREATE INDEX ix_monitor_records_monitor_id_sha256 ON monitor_records (monitor_id, sha256);
CREATE INDEX ix_jobs_model_error ON jobs (owner, model_error, id) WHERE model_error IS NOT NULL;
COMMIT;
