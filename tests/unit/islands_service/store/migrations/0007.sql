BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0007');
CREATE TABLE artefacts (
	job_id VARCHAR(32) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	blob VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_artefacts PRIMARY KEY (job_id, name), 
	CONSTRAINT fk_artefacts_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "artefacts" VALUES('aa961611c7904b80878e9fc6a4378512','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
INSERT INTO "artefacts" VALUES('7a3ff7fd7a7c4184b0f853799bd23f55','pareto.svg','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb');
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
INSERT INTO "audit" VALUES(1,1.7953654342699840069e+09,'cancel-job','alice','9119eec222a74bce8c3e4826487cb60f','0123456789abcdef','192.0.2.1',NULL);
INSERT INTO "audit" VALUES(2,1.7953654342719957828e+09,'delete-job','alice','9119eec222a74bce8c3e4826487cb60f',NULL,'command line',NULL);
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
INSERT INTO "datasets" VALUES('alice','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb-csv','Bühne.csv','.csv','bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb',12,'{"columns": [{"name": "u", "unit": "\u00b5m"}]}',1.79536543423799872399e+09,'{"samples": null, "columns": 1, "time": null, "dt": null, "warnings": 0}',NULL,'https://example.org/a.csv',NULL);
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
INSERT INTO "deliveries" VALUES('80c4a8a81e264981852bb59bb1cc753d','572c6751a4a44beaba1b1defad889736','job.succeeded','aa961611c7904b80878e9fc6a4378512','{"type":"job.succeeded","timestamp":"2026-11-22T16:37:14.255+00:00","data":{"job":"aa961611c7904b80878e9fc6a4378512","kind":"identification","name":"it''s done; really","state":"succeeded","links":{"job":"/v1/jobs/aa961611c7904b80878e9fc6a4378512","result":"/v1/jobs/aa961611c7904b80878e9fc6a4378512/result","report":"/v1/jobs/aa961611c7904b80878e9fc6a4378512/report"}}}',1.79536543425501728056e+09,0,1.79536543425501728056e+09,NULL,NULL,NULL,NULL);
CREATE TABLE events (
	job_id VARCHAR(32) NOT NULL, 
	number BIGINT NOT NULL, 
	kind VARCHAR(16) NOT NULL, 
	data TEXT NOT NULL, 
	at FLOAT NOT NULL, 
	CONSTRAINT pk_events PRIMARY KEY (job_id, number), 
	CONSTRAINT fk_events_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "events" VALUES('aa961611c7904b80878e9fc6a4378512',1,'queued','{}',1.79536543424399352075e+09);
INSERT INTO "events" VALUES('aa961611c7904b80878e9fc6a4378512',2,'running','{"attempt": 1}',1.79536543425099396707e+09);
INSERT INTO "events" VALUES('aa961611c7904b80878e9fc6a4378512',3,'progress','{"generation": 3}',1.79536543425300574305e+09);
INSERT INTO "events" VALUES('aa961611c7904b80878e9fc6a4378512',4,'succeeded','{"best": 0.5}',1.79536543425501728056e+09);
INSERT INTO "events" VALUES('7a3ff7fd7a7c4184b0f853799bd23f55',1,'queued','{}',1.79536543425900030138e+09);
INSERT INTO "events" VALUES('7a3ff7fd7a7c4184b0f853799bd23f55',2,'running','{"attempt": 1}',1.79536543426101207737e+09);
INSERT INTO "events" VALUES('7a3ff7fd7a7c4184b0f853799bd23f55',3,'progress','{"generation": 3}',1.79536543426201796532e+09);
INSERT INTO "events" VALUES('7a3ff7fd7a7c4184b0f853799bd23f55',4,'failed','{"type": "broken", "detail": "it broke"}',1.79536543426398944849e+09);
INSERT INTO "events" VALUES('c6140373e075400483c8208246c19a92',1,'queued','{}',1.79536543426600098604e+09);
INSERT INTO "events" VALUES('c6140373e075400483c8208246c19a92',2,'cancelled','{}',1.79536543426700687412e+09);
INSERT INTO "events" VALUES('f8e590fc7d8a415fa98f9107dff8ada2',1,'queued','{}',1.7953654342730016708e+09);
INSERT INTO "events" VALUES('f8e590fc7d8a415fa98f9107dff8ada2',2,'running','{"attempt": 1}',1.79536543427400732035e+09);
INSERT INTO "events" VALUES('f8e590fc7d8a415fa98f9107dff8ada2',3,'progress','{"generation": 5}',1.79536543427501320844e+09);
INSERT INTO "events" VALUES('2db1a11eecc14889a39673923db1792a',1,'queued','{}',1.79536543427601909643e+09);
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
	finished FLOAT, islands_version VARCHAR(64), checkpoint_version VARCHAR(64), result_version VARCHAR(64), not_before FLOAT DEFAULT 0 NOT NULL, declined TEXT DEFAULT '' NOT NULL, islands INTEGER DEFAULT 1 NOT NULL, 
	CONSTRAINT pk_jobs PRIMARY KEY (id), 
	CONSTRAINT uq_jobs_owner_idempotency_key UNIQUE (owner, idempotency_key)
);
INSERT INTO "jobs" VALUES('aa961611c7904b80878e9fc6a4378512','alice','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'succeeded',4,1,0,NULL,1,1.79536903425099396707e+09,0,'{"generation": 3}',NULL,'{"best": 0.5}',NULL,1.79536543424399352075e+09,1.79536543425501728056e+09,1.79536543425099396707e+09,1.79536543425501728056e+09,'0.1.0','0.1.0','0.1.0',0.0,'',1);
INSERT INTO "jobs" VALUES('7a3ff7fd7a7c4184b0f853799bd23f55','bob','identification','it''s done; really','{"seed": 7}','f5866d15c0cda76da4739fb6deefb1021b93bb38e3184cc2f87a31b3c273b1bc','k',0,'failed',4,1,0,NULL,1,1.79536903426101207732e+09,0,'{"generation": 3}','0000000000000000000000000000000000000000000000000000000000000003',NULL,'{"type": "broken", "detail": "it broke"}',1.79536543425900030138e+09,1.79536543426398944849e+09,1.79536543426101207737e+09,1.79536543426398944849e+09,'0.1.0','0.1.0',NULL,0.0,'',1);
INSERT INTO "jobs" VALUES('c6140373e075400483c8208246c19a92','alice','identification','','{"seed": 7}','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',NULL,0,'cancelled',2,0,0,NULL,0,0.0,1,NULL,NULL,NULL,NULL,1.79536543426600098604e+09,1.79536543426700687412e+09,NULL,1.79536543426700687412e+09,'0.1.0',NULL,NULL,0.0,'',1);
INSERT INTO "jobs" VALUES('f8e590fc7d8a415fa98f9107dff8ada2','alice','identification','','{"seed": 7}','f6c5bcd3d909a363e7a7587adacef58b627c60d8739426f43be90f2151397148',NULL,-7,'running',3,1,0,'cc40e27111a04e31a2d0287e76b02ebd',1,1.79536543327400732045e+09,0,'{"generation": 5}','0000000000000000000000000000000000000000000000000000000000000005',NULL,NULL,1.7953654342730016708e+09,1.79536543427501320844e+09,1.79536543427400732035e+09,NULL,'0.1.0','0.1.0',NULL,0.0,'',1);
INSERT INTO "jobs" VALUES('2db1a11eecc14889a39673923db1792a','bob','identification','','{"value": 0.30000000000000004}','82373462d26bbbd3624b2132ac4a1e2dda7aa144af0f8d5c98cab00845edf90d',NULL,100,'queued',1,0,0,NULL,0,0.0,0,NULL,NULL,NULL,NULL,1.79536543427601909643e+09,1.79536543427601909643e+09,NULL,NULL,'0.1.0',NULL,NULL,0.0,'',1);
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
INSERT INTO "keys" VALUES('ca33c5e423626163','alice','revoked','62556f023008a5aeba54a6e174286c73699d545c5717d2198ea22c1906100c1b','["read", "write"]',1.79536543423200392719e+09,1.79536903423200392727e+09,1.79536543423498129844e+09);
CREATE TABLE models (
	job_id VARCHAR(32) NOT NULL, 
	rank INTEGER NOT NULL, 
	document TEXT NOT NULL, 
	file TEXT NOT NULL, 
	CONSTRAINT pk_models PRIMARY KEY (job_id, rank), 
	CONSTRAINT fk_models_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "models" VALUES('aa961611c7904b80878e9fc6a4378512',1,'{"fitness": 0.5}','first');
INSERT INTO "models" VALUES('aa961611c7904b80878e9fc6a4378512',2,'{"fitness": 0.7}','second');
CREATE TABLE owners (
	name VARCHAR(64) NOT NULL, 
	weight INTEGER NOT NULL, 
	virtual_time BIGINT, 
	max_active BIGINT, 
	max_running BIGINT, 
	max_uploads BIGINT, 
	max_stored BIGINT, 
	max_streams BIGINT, 
	max_drawings BIGINT, dataset_retention BIGINT, max_islands BIGINT, 
	CONSTRAINT pk_owners PRIMARY KEY (name)
);
INSERT INTO "owners" VALUES('alice',100,10000000,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "owners" VALUES('bob',100,0,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE points (
	job_id VARCHAR(32) NOT NULL, 
	generation INTEGER NOT NULL, 
	evaluations BIGINT NOT NULL, 
	best TEXT NOT NULL, 
	islands TEXT NOT NULL, 
	CONSTRAINT pk_points PRIMARY KEY (job_id, generation), 
	CONSTRAINT fk_points_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "points" VALUES('aa961611c7904b80878e9fc6a4378512',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('7a3ff7fd7a7c4184b0f853799bd23f55',3,30,'{"3": 0.25}','[0.5, null]');
INSERT INTO "points" VALUES('f8e590fc7d8a415fa98f9107dff8ada2',5,50,'{"3": 0.16666666666666666}','[0.5, null]');
CREATE TABLE results (
	job_id VARCHAR(32) NOT NULL, 
	document TEXT NOT NULL, 
	CONSTRAINT pk_results PRIMARY KEY (job_id), 
	CONSTRAINT fk_results_job_id FOREIGN KEY(job_id) REFERENCES jobs (id) ON DELETE CASCADE
);
INSERT INTO "results" VALUES('aa961611c7904b80878e9fc6a4378512','{"search": {"seed": 7}}');
CREATE TABLE retired_keys (
	owner VARCHAR(64) NOT NULL, 
	idempotency_key VARCHAR(255) NOT NULL, 
	job_id VARCHAR(32) NOT NULL, 
	request_sha256 VARCHAR(64) NOT NULL, 
	finished FLOAT NOT NULL, 
	CONSTRAINT pk_retired_keys PRIMARY KEY (owner, idempotency_key)
);
INSERT INTO "retired_keys" VALUES('alice','deleted','9119eec222a74bce8c3e4826487cb60f','f926a8ac2bb33cbb3367b345fc57db279a841bb6de19b218d837e39364ef54b8',1.79536543426901841168e+09);
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
INSERT INTO "webhooks" VALUES('572c6751a4a44beaba1b1defad889736','alice','https://hooks.example.org/a','["job.succeeded"]','whsec_OuLzuwF4Qce0OSlu+ogmlKugkmsKFT46z/hTyi6pJXI=',1.7953654342400102615e+09,0.0);
CREATE INDEX ix_jobs_owner_created_id ON jobs (owner, created, id);
CREATE INDEX ix_jobs_owner_state_created_id ON jobs (owner, state, created, id);
CREATE INDEX ix_audit_at ON audit (at);
CREATE INDEX ix_audit_owner_at ON audit (owner, at);
CREATE INDEX ix_owners_virtual_time ON owners (virtual_time);
CREATE INDEX ix_webhooks_owner ON webhooks (owner);
CREATE INDEX ix_deliveries_webhook_id_next_at ON deliveries (webhook_id, next_at);
CREATE INDEX ix_deliveries_webhook_id_created ON deliveries (webhook_id, created);
CREATE INDEX ix_jobs_queue ON jobs (state, owner, priority DESC, created, id, islands);
COMMIT;
